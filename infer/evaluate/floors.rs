//! What even a perfect estimate scores: the noise floor of each number, without any optimisation.

use std::path::Path;

use anyhow::{Context, Result};
use burn::tensor::{Device, Tensor, TensorData};
use image::{DynamicImage, imageops::FilterType};
use object_pba::{
    bundle_adjustment::{BundleAdjustmentConfig, shape_model::KnownPoints, unknowns::Unknowns},
    checkpoint::Prior,
    data::sequence::{Sequence, Truth},
    initial_guess::true_unknowns,
    metrics::{CloudErrors, SamplingNoise},
    reconstruction::score,
};
use serde::{Deserialize, Serialize};

use super::measured::Measured;

/// Longest side of a picture in the list of sequences, in pixels.
const THUMBNAIL: u32 = 112;
/// The reference frame of a sequence, small.
pub const THUMBNAIL_FILE: &str = "reference.png";

/// `None` where the truth does not tell.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Floors {
    /// At the true poses and the encoded true shape: what the prior's best knowledge scores.
    pub at_truth: Option<Measured>,
    /// At the true poses and the true points, as many as the prior has: L_ph and L_CD of the data.
    pub true_points: Option<Measured>,
    /// Two samplings of the true surface, at the numbers of points of estimate and truth.
    pub sampling: Option<CloudErrors>,
    pub n_true_points: usize,
}

impl Floors {
    pub fn new(
        prior: &Prior,
        sequence: &Sequence,
        config: &BundleAdjustmentConfig,
        device: &Device,
    ) -> Self {
        let generator = &prior.shape.generator;
        let parameterisation = config.objective.parameterisation;
        let at_truth = true_unknowns(prior, sequence, parameterisation)
            .map(|unknowns| score(sequence, generator, &unknowns, device).into());
        let truth = sequence.truth.as_ref().filter(|truth| truth.canonical);
        let known = truth.and_then(|truth| Some((truth, truth.points.as_ref()?)));
        let Some((truth, points)) = known else { return Self { at_truth, ..Self::default() } };
        let points: Vec<[f32; 3]> = points.iter().map(|point| point.coords.into()).collect();
        let n = generator.n_points();
        Self {
            at_truth,
            true_points: Some(of_points(sequence, truth, &points[..n.min(points.len())], device)),
            sampling: SamplingNoise::of(&points).map(|noise| noise.at(n, points.len())),
            n_true_points: points.len(),
        }
    }
}

/// L_ph and L_CD of the true points; their other errors say nothing.
fn of_points(sequence: &Sequence, truth: &Truth, points: &[[f32; 3]], device: &Device) -> Measured {
    let data = TensorData::new(points.concat(), [1, points.len(), 3]);
    let shape = KnownPoints(Tensor::from_data(data, &device.clone().inner()));
    let unknowns = Unknowns::with_poses(&truth.camera_from_world, &[], Default::default());
    let measured = Measured::from(score(sequence, &shape, &unknowns, device));
    Measured {
        photometric_loss: measured.photometric_loss,
        silhouette_loss: measured.silhouette_loss,
        ..Measured::default()
    }
}

/// Writes the reference frame, small, for the list of sequences.
pub fn write_thumbnail(sequence: &Sequence, folder: &Path) -> Result<()> {
    let picture = DynamicImage::from(sequence.frames[0].color.clone()).to_rgb8();
    let picture = DynamicImage::from(picture).resize(THUMBNAIL, THUMBNAIL, FilterType::Triangle);
    let path = folder.join(THUMBNAIL_FILE);
    picture.save(&path).with_context(|| format!("cannot write {}", path.display()))
}
