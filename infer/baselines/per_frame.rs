//! Table 1's first row, after Zhu et al. 2017: a style and a pose from each frame by itself.

use anyhow::{Context, Result};
use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::Isometry3;
use object_pba::{
    bundle_adjustment::unknowns::Unknowns,
    checkpoint::Prior,
    data::sequence::{Frame, Sequence},
    host::host_points,
    initial_guess::InitialGuess,
    metrics::CloudErrors,
    reconstruction::score,
};

/// Every frame has a shape of its own, so that there is no L_ph.
pub struct PerFrame {
    /// `camera_from_world` of each frame, the likeliest.
    pub poses: Vec<Isometry3<f32>>,
    /// One style a frame.
    pub styles: Vec<Vec<f32>>,
}

/// What the regressors make of each frame, on its own.
pub fn per_frame(prior: &Prior, sequence: &Sequence) -> Result<PerFrame> {
    let regress = |frame: &Frame| {
        let guess = InitialGuess::of_frame(prior, sequence, frame);
        guess.with_context(|| format!("{} has no mask, or an empty one", frame.path.display()))
    };
    let guesses: Vec<InitialGuess> = sequence.frames.iter().map(regress).collect::<Result<_>>()?;
    Ok(PerFrame {
        poses: guesses.iter().map(|guess| guess.poses[0].0).collect(),
        styles: guesses.into_iter().map(|guess| guess.style).collect(),
    })
}

impl PerFrame {
    /// The cloud of a frame, in world units.
    pub fn cloud(&self, frame_idx: usize, prior: &Prior, device: &Device) -> Vec<[f32; 3]> {
        let style = &self.styles[frame_idx];
        let data = TensorData::new(style.clone(), [1, style.len()]);
        let style = Tensor::from_data(data, &device.clone().inner());
        host_points(&prior.shape.generator.forward(style))
    }

    /// Errors of the clouds, averaged over frames.
    pub fn cloud_errors(&self, truth: &[[f32; 3]], prior: &Prior, device: &Device) -> CloudErrors {
        let errors: Vec<CloudErrors> = (0..self.styles.len())
            .map(|idx| CloudErrors::new(&self.cloud(idx, prior, device), truth))
            .collect();
        let mean = |value: fn(&CloudErrors) -> f64| {
            errors.iter().map(value).sum::<f64>() / errors.len() as f64
        };
        CloudErrors {
            squared_to_truth: mean(|errors| errors.squared_to_truth),
            squared_from_truth: mean(|errors| errors.squared_from_truth),
            distance_to_truth: mean(|errors| errors.distance_to_truth),
            distance_from_truth: mean(|errors| errors.distance_from_truth),
            precision: mean(|errors| errors.precision),
            recall: mean(|errors| errors.recall),
        }
    }

    /// Eq. 5, each frame's silhouette against its own shape; `None` of a single frame, as there.
    pub fn silhouette_loss(
        &self,
        prior: &Prior,
        sequence: &Sequence,
        device: &Device,
    ) -> Option<f64> {
        let of_frame = |idx: usize| {
            // Eq. 5 leaves out the first frame: the one in question comes twice.
            let frames = vec![sequence.frames[idx].clone(); 2];
            let alone = Sequence { frames, truth: None, ..sequence.clone() };
            let poses = [self.poses[idx]; 2];
            let unknowns = Unknowns::with_poses(&poses, &self.styles[idx], Default::default());
            score(&alone, &prior.shape.generator, &unknowns, device).silhouette_loss
        };
        let targets = 1..sequence.frames.len();
        let n_targets = targets.len();
        (n_targets > 0).then(|| targets.map(of_frame).sum::<f64>() / n_targets as f64)
    }
}
