//! Image sequences: what the optimiser reads, and how to make one from a mesh (Sec. 3.1).
//!
//! "We render one sequence for each model, with randomized starting pose p_0, and then apply rotation
//! to the camera around a random sampled axis to create a sequence of 15 frames, each of 2° rotation
//! from its predecessor." The axis runs through the object's centre, so the object stays in view.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{
    ColorImage, ScalarImage, keyed_rng,
    lighting::{Ground, Scene},
    mesh::Mesh,
    rasteriser::Renderer,
    surface::sample_surface,
    viewpoint::{Viewpoint, ViewpointRange, between, box_in_frame, projected_box},
};
use crate::{camera::Intrinsics, silhouette::MASK_THRESHOLD};

/// Pictures of one object by one camera.
#[derive(Clone, Debug)]
pub struct Sequence {
    pub name: String,
    pub intrinsics: Intrinsics,
    /// `[width, height]` of every frame, in pixels.
    pub size: [usize; 2],
    /// Frame 0 is the reference frame.
    pub frames: Vec<Frame>,
    pub truth: Option<Truth>,
}

#[derive(Clone, Debug)]
pub struct Frame {
    /// The picture's file, relative to the sequence's folder.
    pub path: PathBuf,
    pub color: ColorImage,
    /// How much of each pixel the object covers, in [0, 1]; zero everywhere if it is not known.
    pub mask: ScalarImage,
}

impl Frame {
    /// Whether it is known where the object is.
    pub fn has_mask(&self) -> bool {
        self.mask.pixels().any(|coverage| coverage.0[0] > MASK_THRESHOLD)
    }
}

/// What is known of how the pictures came about.
#[derive(Clone, Debug)]
pub struct Truth {
    /// One pose a frame.
    pub camera_from_world: Vec<Isometry3<f32>>,
    /// Whether the world is the canonical frame. If not, only relative poses mean something.
    pub canonical: bool,
    /// The object's surface, in the canonical frame.
    pub points: Option<Vec<Point3<f32>>>,
}

/// How to make a sequence; the defaults are the paper's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SequenceOptions {
    pub n_frames: usize,
    /// Rotation from one frame to the next.
    pub step_degrees: f32,
    /// `[width, height]`, in pixels.
    pub size: [usize; 2],
    /// Most that a frame strays sideways from the start, as a share of the depth.
    pub lateral_jitter: f32,
    /// Most that a frame strays in depth from the start, as a share of it.
    pub depth_jitter: f32,
    /// Whether the object stands on a carpet.
    pub ground: bool,
    /// Points of the true cloud; 0 leaves it out.
    pub n_true_points: usize,
    /// Where the first frame may be taken from.
    pub viewpoint: ViewpointRange,
}

impl Default for SequenceOptions {
    fn default() -> Self {
        Self {
            n_frames: 15,
            step_degrees: 2.0,
            size: [128, 128],
            lateral_jitter: 0.003,
            depth_jitter: 0.005,
            ground: true,
            n_true_points: 24_576,
            viewpoint: ViewpointRange::default(),
        }
    }
}

impl Sequence {
    /// The first `n_frames` alone, or all where there are fewer.
    pub fn first_frames(mut self, n_frames: usize) -> Self {
        self.frames.truncate(n_frames);
        if let Some(truth) = &mut self.truth {
            truth.camera_from_world.truncate(n_frames);
        }
        self
    }

    /// The same pictures, of which another is the reference frame: it comes first, the others keep their
    /// order. Panics if there is no such frame.
    pub fn with_reference(mut self, frame: usize) -> Self {
        self.frames[..=frame].rotate_right(1);
        if let Some(truth) = &mut self.truth {
            truth.camera_from_world[..=frame].rotate_right(1);
        }
        self
    }

    /// Renders a sequence of a mesh in the canonical frame. The same seed makes the same sequence.
    pub fn render(mesh: &Mesh, options: &SequenceOptions, seed: u64) -> Self {
        let [mut motion_rng, mut scene_rng, mut points_rng] =
            [0, 1, 2].map(|purpose| keyed_rng(seed, [purpose, 0]));
        let lowest = mesh.bounds().map_or(0.0, |bounds| bounds.min.y);
        let ground = options.ground.then(|| Ground::random(&mut scene_rng, lowest));
        let floor = if options.ground { lowest } else { f32::NEG_INFINITY };
        let (start, camera_from_world) = motion(&mesh.vertices, floor, options, &mut motion_rng);

        let scene = Scene::random(&mut scene_rng, ground);
        let renderer = Renderer::new(mesh);
        let frames = camera_from_world.iter().enumerate().map(|(idx, pose)| {
            let rendering = renderer.render(&scene, pose, &start.intrinsics, start.size);
            let path = format!("images/frame_{idx:03}.png").into();
            Frame { path, color: rendering.color, mask: rendering.coverage }
        });
        Self {
            name: format!("seed_{seed}"),
            intrinsics: start.intrinsics,
            size: start.size,
            frames: frames.collect(),
            truth: Some(Truth {
                canonical: true,
                points: (options.n_true_points > 0)
                    .then(|| sample_surface(mesh, options.n_true_points, &mut points_rng)),
                camera_from_world,
            }),
        }
    }
}

/// A random start and the poses from there on, above the floor and with the object in every frame.
fn motion(
    points_in_world: &[Point3<f32>],
    floor: f32,
    options: &SequenceOptions,
    rng: &mut impl Rng,
) -> (Viewpoint, Vec<Isometry3<f32>>) {
    /// Starts to try: more than enough, unless the range only holds views from below the floor.
    const STARTS: usize = 50;
    let mut draw = || {
        let start = Viewpoint::random(points_in_world, options.size, &options.viewpoint, rng);
        let poses = orbit(&start.camera_from_world, options, rng);
        (start, held_in_frame(poses, points_in_world, &start))
    };
    let above_floor =
        |pose: &Isometry3<f32>| pose.inverse_transform_point(&Point3::origin()).y > floor;
    let mut drawn = draw();
    for _ in 1..STARTS {
        if drawn.1.iter().all(above_floor) {
            break;
        }
        drawn = draw();
    }
    drawn
}

/// Turns step by step about an axis through the object's centre: x_cam = ΔR R_0 x + t_0 + Δt.
fn orbit(
    start: &Isometry3<f32>,
    options: &SequenceOptions,
    rng: &mut impl Rng,
) -> Vec<Isometry3<f32>> {
    let axis = random_direction(rng);
    let step = options.step_degrees.to_radians();
    let depth = start.translation.vector.z;
    let pose_at = |frame_idx: usize| {
        let mut pose = *start;
        if frame_idx > 0 {
            let turn = UnitQuaternion::from_axis_angle(&axis, step * frame_idx as f32);
            pose.rotation = turn * start.rotation;
            let most = [options.lateral_jitter, options.lateral_jitter, options.depth_jitter];
            let strayed = most.map(|share| share * depth * between([-1.0, 1.0], rng));
            pose.translation.vector += Vector3::from(strayed);
        }
        pose
    };
    (0..options.n_frames).map(pose_at).collect()
}

/// Steps back, all frames alike, until each of them holds the whole object.
fn held_in_frame(
    mut poses: Vec<Isometry3<f32>>,
    points_in_world: &[Point3<f32>],
    Viewpoint { intrinsics, size, .. }: &Viewpoint,
) -> Vec<Isometry3<f32>> {
    /// Steps of 2 %: enough to go ten times as far.
    const STEPS: usize = 120;
    for _ in 0..STEPS {
        let holds = |pose| {
            projected_box(points_in_world, pose, intrinsics)
                .is_none_or(|bounds| box_in_frame(bounds, *size))
        };
        if poses.iter().all(holds) {
            break;
        }
        for pose in &mut poses {
            pose.translation.vector *= 1.02;
        }
    }
    poses
}

/// Uniform on the sphere: a point of the cube that lies in the ball, brought to its surface.
fn random_direction(rng: &mut impl Rng) -> Unit<Vector3<f32>> {
    loop {
        let point = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f32));
        if (1e-6..1.0).contains(&point.norm_squared()) {
            return Unit::new_normalize(point);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::procedural::car;

    fn quick() -> SequenceOptions {
        SequenceOptions { size: [48, 40], n_true_points: 100, ..SequenceOptions::default() }
    }

    #[test]
    fn each_frame_is_two_degrees_from_the_one_before() {
        for seed in 0..3 {
            let truth = Sequence::render(&car(seed), &quick(), seed).truth.expect("it is rendered");
            assert_eq!(truth.camera_from_world.len(), 15);
            for pair in truth.camera_from_world.windows(2) {
                let angle = pair[0].rotation.angle_to(&pair[1].rotation).to_degrees();
                assert!((angle - 2.0).abs() < 0.05, "{angle}");
            }
        }
    }

    #[test]
    fn the_object_is_whole_in_every_frame_and_the_camera_above_the_carpet() {
        for seed in 0..12 {
            let mesh = car(seed);
            let sequence = Sequence::render(&mesh, &quick(), seed);
            let truth = sequence.truth.expect("it is rendered");
            let floor = mesh.bounds().expect("it has triangles").min.y;
            for (pose, frame) in truth.camera_from_world.iter().zip(&sequence.frames) {
                let bounds = projected_box(&mesh.vertices, pose, &sequence.intrinsics);
                assert!(box_in_frame(bounds.expect("it is in view"), sequence.size));
                assert!(pose.inverse_transform_point(&Point3::origin()).y > floor);
                assert!(frame.mask.pixels().any(|value| value.0[0] == 1.0));
            }
        }
    }

    #[test]
    fn translations_stray_within_their_share_of_the_depth() {
        let start = Isometry3::translation(0.1, -0.1, 2.0);
        let poses = orbit(&start, &quick(), &mut keyed_rng(3, [0, 0]));
        assert_eq!(poses[0], start);
        for pose in &poses[1..] {
            let strayed = pose.translation.vector - start.translation.vector;
            assert!(
                strayed.xy().amax() <= 0.006 && strayed.z.abs() <= 0.01 && strayed.norm() > 0.0
            );
        }
    }

    #[test]
    fn one_seed_makes_one_sequence() {
        let render = |seed| Sequence::render(&car(1), &quick(), seed);
        let [first, again, other] = [render(5), render(5), render(6)];
        assert_eq!(first.frames[7].color, again.frames[7].color);
        assert_ne!(first.frames[7].color, other.frames[7].color);
    }

    #[test]
    fn any_frame_may_be_the_reference() {
        let options = SequenceOptions { n_frames: 4, size: [16, 12], ..Default::default() };
        let sequence = Sequence::render(&crate::data::procedural::car(1), &options, 1);
        let before = sequence.clone();
        let after = sequence.with_reference(2);
        let poses =
            |sequence: &Sequence| sequence.truth.clone().expect("rendered").camera_from_world;
        for (place, frame) in [2, 0, 1, 3].into_iter().enumerate() {
            assert_eq!(after.frames[place].path, before.frames[frame].path);
            assert_eq!(poses(&after)[place], poses(&before)[frame]);
        }
    }
}
