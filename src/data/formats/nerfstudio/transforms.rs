//! What `transforms.json` holds.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    Result,
    camera::Intrinsics,
    data::formats::{
        axes::{self, TransformMatrix},
        write_atomically,
    },
};

/// The `world` whose axes are those of the shape prior.
const CANONICAL: &str = "canonical";
/// Camera models that are pinholes, given that their distortion is zero.
const PINHOLES: [&str; 5] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL"];

/// The file. Lengths are in pixels, and angles in radians.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Transforms {
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_model: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_angle_x: Option<f64>,
    #[serde(flatten)]
    lens: Lens,
    #[serde(skip_serializing_if = "Option::is_none")]
    w: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<String>,
    pub frames: Vec<FrameEntry>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Relative to the folder.
    pub file_path: PathBuf,
    /// Relative to the folder; without it, the picture's alpha channel is the mask.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask_path: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transform_matrix: Option<TransformMatrix>,
    #[serde(flatten)]
    lens: Lens,
}

/// Focal lengths, principal point and distortion: of all frames or, not supported, of one.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Lens {
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_y: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(skip_serializing)]
    k1: f64,
    #[serde(skip_serializing)]
    k2: f64,
    #[serde(skip_serializing)]
    k3: f64,
    #[serde(skip_serializing)]
    k4: f64,
    #[serde(skip_serializing)]
    p1: f64,
    #[serde(skip_serializing)]
    p2: f64,
}

impl FrameEntry {
    pub fn new(
        file_path: PathBuf,
        mask_path: Option<PathBuf>,
        pose: Option<&Isometry3<f32>>,
    ) -> Self {
        let transform_matrix = pose.map(axes::transform_matrix);
        Self { file_path, mask_path, transform_matrix, lens: Lens::default() }
    }
}

impl Transforms {
    pub fn new(
        Intrinsics { focal, center }: &Intrinsics,
        size: [usize; 2],
        frames: Vec<FrameEntry>,
        canonical: bool,
    ) -> Self {
        let [fl_x, fl_y, cx, cy] =
            [focal[0], focal[1], center[0], center[1]].map(|length| Some(f64::from(length)));
        let [w, h] = size.map(|side| Some(side as f64));
        Self {
            camera_model: Some("PINHOLE".into()),
            lens: Lens { fl_x, fl_y, cx, cy, ..Lens::default() },
            w,
            h,
            world: canonical.then(|| CANONICAL.into()),
            frames,
            ..Self::default()
        }
    }

    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(self).expect("the fields are plain JSON");
        text.push(b'\n');
        write_atomically(path, &text)
    }

    /// Whether poses are in the object's canonical frame.
    pub fn canonical(&self) -> bool {
        self.world.as_deref() == Some(CANONICAL)
    }

    /// The reason, if this is not one pinhole camera's sequence.
    pub fn check_supported(&self) -> Result<(), String> {
        if self.frames.is_empty() {
            return Err("it has no frames".into());
        }
        if let Some(model) = self.camera_model.as_deref().filter(|model| !PINHOLES.contains(model))
        {
            return Err(format!(
                "camera model {model} is not supported; undistort it to a pinhole"
            ));
        }
        let Lens { k1, k2, k3, k4, p1, p2, .. } = self.lens;
        if [k1, k2, k3, k4, p1, p2].iter().any(|coefficient| *coefficient != 0.0) {
            return Err("lens distortion (k1 to k4, p1, p2) is not supported; undistort it".into());
        }
        let own = |entry: &FrameEntry| entry.lens != Lens::default() && entry.lens != self.lens;
        match self.frames.iter().position(own) {
            Some(idx) => {
                Err(format!("frame {idx} has its own intrinsics; one camera is supported"))
            }
            None => Ok(()),
        }
    }

    /// The one size that all pictures have, and that the file states if it states one.
    pub fn common_size(
        &self,
        mut sizes: impl Iterator<Item = [usize; 2]>,
    ) -> Result<[usize; 2], String> {
        let first = sizes.next().ok_or("it has no frames")?;
        let mut others = self.frames.iter().skip(1).zip(sizes);
        if let Some((frame, size)) = others.find(|(_, size)| *size != first) {
            let path = frame.file_path.display();
            return Err(format!("{path} is {size:?} pixels, and the first frame {first:?}"));
        }
        let stated = [self.w, self.h];
        let differs = |(stated, side): (Option<f64>, usize)| {
            stated.is_some_and(|length| length != side as f64)
        };
        if stated.into_iter().zip(first).any(differs) {
            return Err(format!("its pictures are {first:?} pixels, not w × h"));
        }
        Ok(first)
    }

    /// Missing ones follow from others: `fl_x` from the angle of view, `fl_y` from `fl_x`, and the
    /// principal point from the size.
    pub fn intrinsics(&self, [width, height]: [usize; 2]) -> Result<Intrinsics, String> {
        let from_angle = self.camera_angle_x.map(|angle| 0.5 * width as f64 / (0.5 * angle).tan());
        let fl_x = self.lens.fl_x.or(from_angle).ok_or("it has no fl_x and no camera_angle_x")?;
        let focal = [fl_x, self.lens.fl_y.unwrap_or(fl_x)];
        let center = [
            self.lens.cx.unwrap_or(width as f64 / 2.0),
            self.lens.cy.unwrap_or(height as f64 / 2.0),
        ];
        // Far beyond any lens, and well within single precision.
        let possible = 1e-3..1e9;
        if !focal.iter().all(|length| possible.contains(length)) {
            return Err(format!("its focal lengths {focal:?} are not positive"));
        }
        if !center.iter().all(|coordinate| coordinate.abs() < possible.end) {
            return Err(format!("its principal point {center:?} is not finite"));
        }
        let single = |lengths: [f64; 2]| lengths.map(|length| length as f32);
        Ok(Intrinsics { focal: single(focal), center: single(center) })
    }

    /// `camera_from_world` of every frame, or of none.
    pub fn poses(&self) -> Result<Option<Vec<Isometry3<f32>>>, String> {
        let matrices: Vec<_> =
            self.frames.iter().filter_map(|entry| entry.transform_matrix.as_ref()).collect();
        if matrices.is_empty() {
            return Ok(None);
        }
        if matrices.len() < self.frames.len() {
            return Err("some frames have a transform_matrix and some have none".into());
        }
        let poses = matrices.into_iter().enumerate().map(|(idx, matrix)| {
            axes::camera_from_world(matrix).map_err(|reason| format!("frame {idx}: {reason}"))
        });
        poses.collect::<Result<_, _>>().map(Some)
    }
}
