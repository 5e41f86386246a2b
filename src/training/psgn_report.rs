//! The direct regression beside what else may stand for the shape in a picture: a table's numbers.

use std::path::Path;

use burn::tensor::{Device, Tensor};

use super::{
    DataConfig, PsgnTrainingConfig,
    batches::{cloud_tensor, row_tensor},
    crops::Crop,
    psgn_stage::HeldOutClouds,
    shapes::Shapes,
    stage::SCALE,
};
use crate::{
    Error, Result,
    bundle_adjustment::{point_subset::PointSubset, shape_model::ShapeModel},
    chamfer::chamfer_distance,
    checkpoint::Prior,
    host::host_values,
    psgn::Psgn,
};

/// Clouds of one kind, one for each picture of a held-out shape.
pub struct ComparedClouds {
    pub what: &'static str,
    /// Eq. 7 to as many points of the true surface, in thousandths of squared world units.
    pub distances: Vec<f64>,
}

/// What there is to compare with: clouds of as many points in the same frame, for the same pictures.
struct Comparison<'a> {
    prior: &'a Prior,
    /// As many of the generator's points.
    generator: PointSubset<'a>,
    held_out: &'a HeldOutClouds,
    device: &'a Device,
}

/// Compares the network in the folder `out` with what a prior makes of the same pictures.
pub fn compare_clouds(
    config: &PsgnTrainingConfig,
    out: &Path,
    prior: &Prior,
    device: &Device,
) -> Result<Vec<ComparedClouds>> {
    let unlike = |reason: &str| Error::Config { path: out.into(), reason: reason.into() };
    if !sees_the_same(config, prior) {
        return Err(unlike("the prior was trained on other shapes, or sees other crops"));
    }
    let (n, n_seen) = (config.network.n_points(), prior.config.prior.network.n_encoder_points);
    if n > prior.shape.generator.n_points() {
        return Err(unlike("the prior has fewer points"));
    }
    let psgn = Psgn::load(out, device)?;
    let shapes = Shapes::open(&config.data, config.seed)?;
    let held_out = HeldOutClouds::prepare(&config.crops(), &shapes, n, n_seen.max(n))?;
    let comparison = Comparison {
        prior,
        generator: PointSubset::new(&prior.shape.generator, n),
        held_out: &held_out,
        device,
    };
    let mean_style = Tensor::zeros([1, prior.shape.n_style()], device);
    let seen = |crop: &Crop, n: usize| held_out.others[crop.shape_idx][..n].to_vec();
    let encode = |crop: &Crop| prior.shape.encode(cloud_tensor(&[seen(crop, n_seen)], device));
    let rows = [
        ("mean shape", comparison.of_styles(|_| mean_style.clone())),
        ("direct regression (Fan et al.)", held_out.distances(&psgn, device)),
        ("regressed style, decoded", comparison.of_styles(|crop| comparison.regress(crop))),
        ("encoded true style, decoded", comparison.of_styles(encode)),
        (
            "another sampling of the surface",
            comparison.of_clouds(|crop| cloud_tensor(&[seen(crop, n)], device)),
        ),
    ];
    Ok(rows.map(|(what, distances)| ComparedClouds { what, distances }).into())
}

impl Comparison<'_> {
    fn regress(&self, crop: &Crop) -> Tensor<2> {
        let size = self.prior.regressors.crop_size();
        let values = row_tensor(&[crop.values()], self.device).reshape([1, size, size, 4]);
        let focal_ratio = row_tensor(&[vec![crop.focal_ratio]], self.device);
        self.prior.regressors.forward(values, focal_ratio).0
    }

    fn of_styles(&self, style: impl Fn(&Crop) -> Tensor<2>) -> Vec<f64> {
        self.of_clouds(|crop| self.generator.points(style(crop)))
    }

    /// Distances of one cloud a picture, `[1, n, 3]`.
    fn of_clouds(&self, cloud: impl Fn(&Crop) -> Tensor<3>) -> Vec<f64> {
        let distance = |crop: &Crop| {
            let truth = std::slice::from_ref(&self.held_out.truth[crop.shape_idx]);
            let distance = chamfer_distance(cloud(crop), cloud_tensor(truth, self.device));
            SCALE * f64::from(host_values(&distance)[0])
        };
        self.held_out.crops.iter().map(distance).collect()
    }
}

/// Whether both were trained on the same shapes, so that what one held out the other did, too, and see
/// the same crops.
fn sees_the_same(config: &PsgnTrainingConfig, prior: &Prior) -> bool {
    let shapes = |seed: u64, data: &DataConfig| {
        let kept = DataConfig::default();
        let DataConfig { n_models, n_validation, meshes, synset, split, up, front, .. } =
            data.clone();
        let (include, exclude) = (data.include.clone(), data.exclude.clone());
        let chosen =
            DataConfig { n_models, n_validation, meshes, synset, split, up, front, ..kept };
        (seed, DataConfig { include, exclude, ..chosen })
    };
    let crop = (config.network.crop_size, config.network.crop_margin);
    let regressors = &prior.regressors;
    crop == (regressors.crop_size(), regressors.crop_margin())
        && shapes(config.seed, &config.data) == shapes(prior.config.seed, &prior.config.data)
}
