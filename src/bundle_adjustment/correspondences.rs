//! What is compared with what, decided outside the graph from the current estimate: which points a
//! view sees, which colours may be compared, which silhouette pixel belongs to which point.

use burn::tensor::Tensor;
use nalgebra::{Isometry3, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    exposure::Exposure,
    objective::{ObjectiveConfig, Reduction},
    observations::Observations,
};
use crate::{
    camera::{Intrinsics, NEAR, Pose},
    host::host_points,
    loss::{SilhouetteMatching, SilhouettePair, SilhouetteTolerances, silhouette_pairs},
    pseudo_render::visible_points,
};

/// The correspondences of the reference frame and some targets.
pub struct Correspondences {
    /// The frames, the reference first.
    pub frames: Vec<usize>,
    /// The cloud, in the world frame.
    pub points: Vec<[f32; 3]>,
    /// Where every point lands in each of them, in pixels.
    pub pixels: Vec<Vec<[f32; 2]>>,
    /// How many of them land inside its picture, and how many lie behind its camera.
    pub n_in_frame: Vec<usize>,
    pub n_behind: Vec<usize>,
    /// The points that each of them sees.
    pub visible: Vec<Vec<u32>>,
    /// For each target, 1 where a point that the reference sees may be compared, else 0: `[t][m]`.
    pub comparable: Vec<Vec<f32>>,
    /// The silhouette's pairs, each list with its place in `frames`.
    pub pairs: Vec<(usize, Vec<SilhouettePair>)>,
    /// How each target is exposed.
    pub exposures: Vec<Exposure>,
}

impl Correspondences {
    /// Of a cloud `[1, n, 3]` seen from `poses`, one for each of `frames`.
    pub fn new(
        observations: &Observations,
        frames: Vec<usize>,
        (points_in_world, poses, intrinsics): (&Tensor<3>, &Pose, &Intrinsics),
        config: &ObjectiveConfig,
        level: usize,
    ) -> Self {
        let size = observations.size;
        let points = host_points(points_in_world);
        let cloud = points_in_world.clone();
        let visible = visible_points(cloud, poses, intrinsics, size, &config.pseudo_render);
        let poses = poses.to_isometries();
        let (pixels, n_behind): (Vec<_>, Vec<_>) =
            poses.par_iter().map(|pose| projected(&points, pose, intrinsics)).unzip();
        let in_frame = |[u, v]: &&[f32; 2]| {
            (0.0..size[0] as f32).contains(u) && (0.0..size[1] as f32).contains(v)
        };
        let n_in_frame = pixels.iter().map(|pixels| pixels.iter().filter(in_frame).count());
        let n_in_frame = n_in_frame.collect();
        let comparable = (1..frames.len())
            .into_par_iter()
            .map(|t| {
                comparable(observations, [frames[0], frames[t]], [0, t], &pixels, &visible, config)
            })
            .collect();
        let pairs = pairs(observations, &frames, &pixels, &visible, config, level);
        // Colours tell, which are the graph's.
        let exposures = vec![Exposure::NEUTRAL; frames.len() - 1];
        Self { frames, points, pixels, n_in_frame, n_behind, visible, comparable, pairs, exposures }
    }

    /// Whether every point lands somewhere.
    pub fn are_finite(&self) -> bool {
        self.pixels.iter().flatten().flatten().all(|x| x.is_finite())
    }

    /// How many colours are compared, all targets together; at least one.
    pub fn n_compared(&self) -> f32 {
        self.comparable.iter().flatten().sum::<f32>().max(1.0)
    }
}

/// Where every point lands in one view, as [`Intrinsics::project`] has it, and how many lie behind it.
fn projected(
    points: &[[f32; 3]],
    camera_from_world: &Isometry3<f32>,
    intrinsics: &Intrinsics,
) -> (Vec<[f32; 2]>, usize) {
    let rotation = camera_from_world.rotation.to_rotation_matrix().into_inner();
    let translation = camera_from_world.translation.vector;
    let [focal, center] = [intrinsics.focal, intrinsics.center].map(Vector2::from);
    let mut n_behind = 0;
    let pixel = |&point: &[f32; 3]| {
        let in_camera = rotation * Vector3::from(point) + translation;
        n_behind += usize::from(in_camera.z <= NEAR);
        let slopes = in_camera.xy() / in_camera.z.max(NEAR);
        (slopes.component_mul(&focal) + center).into()
    };
    (points.iter().map(pixel).collect(), n_behind)
}

/// Whether each point that the reference sees may be compared with one target.
fn comparable(
    observations: &Observations,
    frames: [usize; 2],
    [reference, target]: [usize; 2],
    pixels: &[Vec<[f32; 2]>],
    visible: &[Vec<u32>],
    config: &ObjectiveConfig,
) -> Vec<f32> {
    let mut hidden = vec![config.target_occlusion; pixels[target].len()];
    visible[target].iter().for_each(|&i| hidden[i as usize] = false);
    let may = |i: usize| {
        let inside = !config.within_masks
            || (observations.shows_object(frames[0], pixels[reference][i])
                && observations.shows_object(frames[1], pixels[target][i]));
        inside && !hidden[i]
    };
    visible[reference].iter().map(|&i| if may(i as usize) { 1.0 } else { 0.0 }).collect()
}

/// The pairs that Eq. 5 adds up, for each frame that has a silhouette.
fn pairs(
    observations: &Observations,
    frames: &[usize],
    pixels: &[Vec<[f32; 2]>],
    visible: &[Vec<u32>],
    config: &ObjectiveConfig,
    level: usize,
) -> Vec<(usize, Vec<SilhouettePair>)> {
    // One frame alone has nothing but its own silhouette.
    let first = usize::from(!config.silhouette_of_reference && frames.len() > 1);
    let [width, height] = observations.size.map(|side| side as f32);
    let spacing = (width * height / pixels[0].len() as f32).sqrt();
    let slack = config.tolerance_per_blur * observations.blurs[level];
    let tolerances = SilhouetteTolerances {
        coverage: config.coverage_tolerance * spacing + slack,
        hole: config.hole_tolerance * spacing + slack,
        containment: config.containment_tolerance + slack,
    };
    let everything: Vec<u32> = (0..pixels[0].len() as u32).collect();
    (first..frames.len())
        .into_par_iter()
        .filter_map(|f| {
            let silhouette = observations.silhouettes[frames[f]].as_ref()?;
            // Where nothing is seen, every point is called back.
            let all = config.silhouette_of_hidden_points || visible[f].is_empty();
            let visible = if all { &everything } else { &visible[f] };
            let weights = match config.reduction {
                Reduction::Sum => [1.0; 2],
                Reduction::Mean => [silhouette.pixels.len(), visible.len()].map(|n| 1.0 / n as f32),
            };
            let matching = SilhouetteMatching {
                to_outline: config.silhouette_outline,
                weights,
                tolerances,
                trim: config.silhouette_trim,
            };
            Some((f, silhouette_pairs(silhouette, &pixels[f], visible, &matching)))
        })
        .collect()
}
