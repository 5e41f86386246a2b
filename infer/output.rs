//! What a reconstruction leaves on disk.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use nalgebra::Point3;
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, Step, Uncertainty},
    checkpoint::Prior,
    config::write_config,
    data::{
        formats::{Trajectory, nerfstudio::write_trajectory, ply},
        sequence::Sequence,
    },
    device::Backend,
    host::host_points,
    reconstruction::{Scores, points, views},
};

use crate::{figures, run::Reconstruction};

/// Colour of points that no frame saw.
const UNSEEN: [u8; 3] = [128; 3];

/// Reads one figure of a state.
pub type Figure = fn(&Scores) -> Option<f64>;

/// The rows of a summary: a name with its unit, and where to read it.
pub const ROWS: [(&str, Figure); 8] = [
    ("reference rotation error (deg)", |s| s.poses.reference_rotation_error_deg),
    ("mean rotation error over frames (deg)", |s| s.poses.rotation_error_deg_mean),
    ("relative rotation error (deg)", |s| s.poses.relative_rotation_error_deg_mean),
    ("aligned rotation error (deg)", |s| s.poses.aligned_rotation_error_deg_mean),
    ("translation error (diagonals)", |s| s.poses.translation_error_mean),
    ("style error, Eq. 7 (1e-3 diagonals²)", |s| s.style_error.map(|error| 1e3 * error)),
    ("photometric loss, Eq. 3", |s| Some(s.photometric_loss)),
    ("silhouette loss, Eq. 5 (px²)", |s| Some(s.silhouette_loss)),
];

/// Writes cameras, cloud, history, config, metrics and figures into `out`.
pub fn write(
    out: &Path,
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    backend: Backend,
    reconstruction: &Reconstruction,
) -> Result<()> {
    let device = backend.device();
    let shape = reconstruction.outcome.shape(&prior.shape.generator);
    let unknowns = &reconstruction.outcome.unknowns;
    let poses = unknowns.camera_from_world(&device);
    let trajectory = Trajectory {
        intrinsics: unknowns.intrinsics(&sequence.intrinsics),
        size: sequence.size,
        camera_from_world: poses.clone(),
        pictures: sequence.frames.iter().map(|frame| frame.path.clone()).collect(),
        canonical: true,
    };
    write_trajectory(&out.join("transforms.json"), &trajectory)?;

    let views = views(sequence, &shape, unknowns, &config.objective.pseudo_render, &device);
    let colors = figures::point_colors(sequence, &views);
    let cloud = host_points(&points(&shape, unknowns, &device));
    let ply = ply::PointCloud {
        points: cloud.iter().map(|&point| Point3::from(point)).collect(),
        colors: Some(colors.iter().map(|color| color.unwrap_or(UNSEEN)).collect()),
        visible: Some(colors.iter().map(Option::is_some).collect()),
    };
    ply::write_points(&out.join("points.ply"), &ply)?;

    write_history(&out.join("history.csv"), &reconstruction.history)?;
    write_config(&out.join("config.toml"), config)?;
    let metrics = serde_json::to_string_pretty(&reconstruction.report)?;
    let path = out.join("metrics.json");
    fs::write(&path, metrics).with_context(|| format!("cannot write {}", path.display()))?;
    if let Some(uncertainty) = &reconstruction.outcome.uncertainty {
        write_uncertainty(&out.join("uncertainty.json"), uncertainty)?;
    }
    figures::write_stages(out, prior, sequence, config, &device, &reconstruction.outcome)?;
    let seen: Vec<[u8; 3]> = colors.iter().map(|color| color.unwrap_or(figures::UNSEEN)).collect();
    figures::write_cloud(&out.join("cloud.png"), &poses[0], &cloud, &seen)
}

/// Covariances row by row, of [φ, ρ]: the true pose is (exp(φ) R, t + ρ), in radians and world units along
/// the camera's axes. Standard deviations of points are in world units, in the order of `points.ply`.
fn write_uncertainty(path: &Path, uncertainty: &Uncertainty) -> Result<()> {
    let poses: Vec<&[f64]> = uncertainty.poses.iter().map(|pose| pose.as_slice()).collect();
    let text = serde_json::json!({ "pose_covariances": poses, "point_sigmas": uncertainty.points });
    fs::write(path, text.to_string()).with_context(|| format!("cannot write {}", path.display()))
}

fn write_history(path: &Path, history: &[Step]) -> Result<()> {
    let mut text = String::from(
        "iteration,hypothesis,blur_px,block,objective,photometric,silhouette,n_visible\n",
    );
    for step in history {
        let Step {
            iteration,
            hypothesis,
            blur,
            block,
            objective,
            photometric,
            silhouette,
            n_visible,
        } = step;
        text += &format!(
            "{iteration},{hypothesis},{blur},{block},{objective},{photometric},{silhouette},{n_visible}\n"
        );
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Four significant digits, without an exponent where a reader can do without.
pub fn significant(value: f64) -> String {
    let digits = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 8) as usize;
    format!("{value:.digits$}")
}
