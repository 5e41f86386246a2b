//! Fig. 7: the shape prior against points that move on their own.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Hypothesis, Solver, bundle_adjust,
        shape_model::{FreePoints, ShapeModel},
        unknowns::Unknowns,
    },
    checkpoint::Prior,
    config::write_config,
    data::sequence::Sequence,
    host::host_points,
    initial_guess::InitialGuess,
    reconstruction::{Scores, points, score, views},
};

use super::arm::freed;
use crate::{Options, figures, input::Input, output, run::NO_REFERENCE_MASK};

pub fn compare_all(sequences: &[PathBuf], out: &Path, options: &Options) -> Result<()> {
    let mut config = options.bundle_adjustment()?;
    // Both arms share a solver, so it has to be one for any number of unknowns.
    if config.solver == Solver::Lm {
        eprintln!(
            "note: lm solves for few directions of a shape, not for free points: both arms use adam"
        );
        config.solver = Solver::Adam;
    }
    let device = options.device.device().autodiff();
    let prior = options.load_prior(&device)?;
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    write_config(&out.join("config.toml"), &config)?;

    let mut table = String::from("| sequence | | initial | shape prior | free points |\n");
    table += "| --- | --- | --- | --- | --- |\n";
    for path in sequences {
        let sequence = Input::default().read(path)?;
        let arms = compare(&prior, &sequence, &config, &device)?;
        for (name, value) in output::ROWS {
            let cell = |scores: &Scores| value(scores).map_or("–".into(), output::significant);
            let [initial, with_prior, free] = arms.each_ref().map(|arm| cell(&arm.scores));
            table +=
                &format!("| {} | {name} | {initial} | {with_prior} | {free} |\n", sequence.name);
        }
        let pictures = arms.each_ref().map(|arm| arm.picture.clone());
        figures::save(&figures::stacked(&pictures), &out.join(format!("{}.png", sequence.name)))?;
    }
    let path = out.join("table.md");
    fs::write(&path, &table).with_context(|| format!("cannot write {}", path.display()))?;
    println!("{table}");
    println!(
        "Each picture in {} shows the cloud at initialisation, with the shape prior and with",
        out.display()
    );
    println!("free points, from four sides; points that no frame saw are red.");
    Ok(())
}

/// One row of the comparison.
struct Arm {
    scores: Scores,
    picture: image::RgbImage,
}

/// Initialisation, the prior and free points: the same start, losses and budget.
fn compare(
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    device: &Device,
) -> Result<[Arm; 3]> {
    let with_prior = InitialGuess::hypotheses(prior, sequence, config);
    if with_prior.is_empty() {
        bail!("{}: {NO_REFERENCE_MASK}", sequence.name);
    }
    let generator = &prior.shape.generator;
    let (free, free_config) = freed(generator, &with_prior, config, device);
    let arm = |shape: &dyn ShapeModel, unknowns: &Unknowns| Arm {
        scores: score(sequence, shape, unknowns, device),
        picture: picture(sequence, shape, unknowns, config, device),
    };
    let adjusted =
        |shape: &dyn ShapeModel, starts: &[Hypothesis], config: &BundleAdjustmentConfig| {
            let outcome = bundle_adjust(sequence, shape, starts, config, device, &mut |_, _| {});
            arm(shape, &outcome.unknowns)
        };
    Ok([
        arm(generator, &with_prior[0].unknowns),
        adjusted(generator, &with_prior, config),
        adjusted(&FreePoints, &free, &free_config),
    ])
}

fn picture(
    sequence: &Sequence,
    shape: &dyn ShapeModel,
    unknowns: &Unknowns,
    config: &BundleAdjustmentConfig,
    device: &Device,
) -> image::RgbImage {
    let views = views(sequence, shape, unknowns, &config.objective.pseudo_render, device);
    let colors = figures::point_colors(sequence, &views);
    let colors: Vec<[u8; 3]> = colors.iter().map(|c| c.unwrap_or(figures::UNSEEN)).collect();
    let cloud = host_points(&points(shape, unknowns, device));
    let reference = unknowns.camera_from_world(device)[0];
    figures::cloud_views(&reference, &cloud, &colors)
}
