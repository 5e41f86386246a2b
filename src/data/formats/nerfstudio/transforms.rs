//! What `transforms.json` holds.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    Result,
    camera::Intrinsics,
    data::formats::{
        axes::{self, TransformMatrix},
        calibration::{Calibration, Distortion},
        write_atomically,
    },
};

/// The `world` whose axes are those of the shape prior.
const CANONICAL: &str = "canonical";
/// Camera models whose coefficients [`Distortion`] knows.
const MODELS: [&str; 6] =
    ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV"];

/// The file. Lengths are in pixels, and angles in radians.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Transforms {
    #[serde(flatten)]
    lens: Lens,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<String>,
    pub frames: Vec<FrameEntry>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Relative to the folder.
    pub file_path: PathBuf,
    /// Relative to the folder; without it, a mask of the same name or the alpha channel is the mask.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask_path: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    transform_matrix: Option<TransformMatrix>,
    #[serde(flatten)]
    lens: Lens,
}

/// A camera: of all frames or, where a frame says otherwise, of one.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Lens {
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_model: Option<String>,
    #[serde(skip_serializing)]
    is_fisheye: Option<bool>,
    #[serde(skip_serializing)]
    camera_angle_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fl_y: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    w: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    h: Option<f64>,
    #[serde(skip_serializing)]
    k1: Option<f64>,
    #[serde(skip_serializing)]
    k2: Option<f64>,
    #[serde(skip_serializing)]
    k3: Option<f64>,
    #[serde(skip_serializing)]
    k4: Option<f64>,
    #[serde(skip_serializing)]
    p1: Option<f64>,
    #[serde(skip_serializing)]
    p2: Option<f64>,
}

impl FrameEntry {
    pub fn new(
        file_path: PathBuf,
        mask_path: Option<PathBuf>,
        pose: Option<&Isometry3<f32>>,
    ) -> Self {
        let transform_matrix = pose.map(axes::to_opengl_matrix);
        Self { file_path, mask_path, transform_matrix, lens: Lens::default() }
    }

    pub fn camera_from_world(&self) -> Result<Option<Isometry3<f32>>, String> {
        self.transform_matrix.as_ref().map(axes::from_opengl_matrix).transpose()
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
        let camera_model = Some("PINHOLE".into());
        let lens = Lens { camera_model, fl_x, fl_y, cx, cy, w, h, ..Lens::default() };
        Self { lens, world: canonical.then(|| CANONICAL.into()), frames }
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

    /// The camera of a frame: what it says itself, else what the file says of all.
    pub fn lens(&self, entry: &FrameEntry) -> Lens {
        let (own, all) = (entry.lens.clone(), self.lens.clone());
        Lens {
            camera_model: own.camera_model.or(all.camera_model),
            is_fisheye: own.is_fisheye.or(all.is_fisheye),
            camera_angle_x: own.camera_angle_x.or(all.camera_angle_x),
            fl_x: own.fl_x.or(all.fl_x),
            fl_y: own.fl_y.or(all.fl_y),
            cx: own.cx.or(all.cx),
            cy: own.cy.or(all.cy),
            w: own.w.or(all.w),
            h: own.h.or(all.h),
            k1: own.k1.or(all.k1),
            k2: own.k2.or(all.k2),
            k3: own.k3.or(all.k3),
            k4: own.k4.or(all.k4),
            p1: own.p1.or(all.p1),
            p2: own.p2.or(all.p2),
        }
    }
}

impl Lens {
    /// `[width, height]`, in pixels.
    pub fn size(&self) -> Option<[usize; 2]> {
        Some([self.w? as usize, self.h? as usize])
    }

    /// Missing lengths follow from others: `fl_x` from the angle of view, `fl_y` from `fl_x`, and the
    /// principal point from the size.
    pub fn calibration(&self, [width, height]: [usize; 2]) -> Result<Calibration, String> {
        let from_angle = self.camera_angle_x.map(|angle| 0.5 * width as f64 / (0.5 * angle).tan());
        let fl_x = self.fl_x.or(from_angle).ok_or("it has no fl_x and no camera_angle_x")?;
        let focal = [fl_x, self.fl_y.unwrap_or(fl_x)];
        let center =
            [self.cx.unwrap_or(width as f64 / 2.0), self.cy.unwrap_or(height as f64 / 2.0)];
        Calibration::new(focal, center, self.distortion()?)
    }

    fn distortion(&self) -> Result<Distortion, String> {
        let unknown = |model: &&str| !MODELS.contains(model);
        if let Some(model) = self.camera_model.as_deref().filter(unknown) {
            return Err(format!(
                "camera model {model} is not supported; undistort it to a pinhole"
            ));
        }
        if self.is_fisheye == Some(true) {
            return Err("fisheye lenses are not supported; undistort it to a pinhole".into());
        }
        let [k1, k2, k3, k4, p1, p2] =
            [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].map(Option::unwrap_or_default);
        if k4 != 0.0 {
            // To OpenCV it stands below the fraction bar, to nerfstudio above it.
            return Err("k4 means different lenses to different programs; undistort it".into());
        }
        Ok(Distortion { radial: [k1, k2, k3], tangential: [p1, p2], ..Distortion::default() })
    }
}
