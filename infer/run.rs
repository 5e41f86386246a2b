//! One sequence: load, initialise, adjust, judge, write.

use std::{fs, path::Path, time::Instant};

use anyhow::{Context, Result};
use burn::tensor::Device;
use indicatif::{ProgressBar, ProgressStyle};
use object_pba::{
    bundle_adjustment::{
        BundleAdjustmentConfig, Exposure, HypothesisReport, Outcome, Solver, Status, Step,
        Uncertainty, WithinTwoSigma, unknowns::Unknowns,
    },
    checkpoint::Prior,
    data::sequence::Sequence,
    device::Backend,
    initial_guess::Start,
    reconstruction::{Scores, reconstruct, score},
};
use serde::Serialize;

use crate::{Options, assets, input::Input, output, report};

/// What `metrics.json` holds.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub initial: Scores,
    #[serde(rename = "final")]
    pub last: Scores,
    pub iterations: usize,
    pub seconds: f64,
    pub n_points: usize,
    pub n_frames: usize,
    pub device: Backend,
    pub solver: Solver,
    /// Why the solver stopped on what it found, and on each hypothesis.
    pub status: Status,
    pub hypotheses: Vec<HypothesisReport>,
    pub uncertainty: Option<UncertaintyReport>,
    /// Focal lengths [f_x, f_y] in pixels, where they are refined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal: Option<[f32; 2]>,
    /// Each target frame's gain and bias, where they are solved for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposures: Option<Vec<Exposure>>,
}

/// Standard deviations: roots of expected squared errors. `null` where the solver knows none.
#[derive(Clone, Debug, Serialize)]
pub struct UncertaintyReport {
    /// Of each frame's orientation, and of each target's relative to the reference frame.
    pub rotation_sigma_deg: Vec<f64>,
    pub relative_rotation_sigma_deg: Vec<f64>,
    /// Of each frame's t, in world units.
    pub translation_sigma: Vec<f64>,
    /// Mean over the points, in world units; `uncertainty.json` has each.
    pub point_sigma_mean: f64,
    /// Where the truth is known in the same world.
    pub within_two_sigma: Option<WithinTwoSigma>,
}

impl UncertaintyReport {
    fn new(found: &Uncertainty, sequence: &Sequence, unknowns: &Unknowns, device: &Device) -> Self {
        let degrees = |radians: Vec<f64>| radians.into_iter().map(f64::to_degrees).collect();
        let truth = sequence.truth.as_ref().filter(|truth| truth.canonical);
        Self {
            rotation_sigma_deg: degrees(found.rotation_deviations()),
            relative_rotation_sigma_deg: degrees(found.relative_rotation_deviations()),
            translation_sigma: found.translation_deviations(),
            point_sigma_mean: found.points.iter().sum::<f64>() / found.points.len().max(1) as f64,
            within_two_sigma: truth.map(|truth| {
                let estimate = unknowns.camera_from_world(device);
                found.within_two_sigma(&estimate, &truth.camera_from_world)
            }),
        }
    }
}

/// Why there is nothing to start from, and what helps. Other frames may do without masks.
pub const NO_REFERENCE_MASK: &str = "the first frame, to which all others refer, has no mask or an empty one; \
    give it one (mask_path, masks/, --masks or an alpha channel), or begin with a frame that has one (--frames)";

/// A finished reconstruction, with all that figures are made from.
pub struct Reconstruction {
    pub outcome: Outcome,
    pub history: Vec<Step>,
    /// The unknowns at each step of the history; some 2 KB each.
    pub trace: Vec<Unknowns>,
    pub report: Report,
}

pub fn demo(out: &Path, with_report: bool, options: &Options) -> Result<()> {
    let sequence = out.join("sequence");
    assets::unpack_sample_sequence(&sequence)
        .with_context(|| format!("cannot write to {}", sequence.display()))?;
    run(&sequence, out, with_report, &Input::default(), options)
}

pub fn run(
    sequence: &Path,
    out: &Path,
    with_report: bool,
    input: &Input,
    options: &Options,
) -> Result<()> {
    let config = options.bundle_adjustment()?;
    let sequence = input.read(sequence)?;
    let device = options.device.device().autodiff();
    let prior = options.load_prior(&device)?;
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;

    let bar = progress_bar(&sequence, &config);
    let reconstruction =
        reconstruct_and_score(&prior, &sequence, &config, options.device, &mut |step, _| {
            bar.inc(1);
            bar.set_message(format!("blur {} px, objective {:.2}", step.blur, step.objective));
        })?;
    bar.finish_and_clear();

    output::write(out, &prior, &sequence, &config, options.device, &reconstruction)?;
    if with_report {
        report::write(out, &prior, &sequence, &config, options.device, &reconstruction)?;
    }
    print_summary(&reconstruction.report);
    println!("Results are in {}:", out.display());
    if with_report {
        println!("  report/index.html  all of it in 3D, step by step: open it in a browser");
    }
    println!("  stages.png       what each stage aligned: reference, target, residual (Fig. 5)");
    println!("  cloud.png        the point cloud from the reference camera and around it");
    println!("  points.ply       the cloud, coloured where it was seen");
    println!("  transforms.json  the camera of every frame");
    println!(
        "  uncertainty.json the covariance of every pose, the standard deviation of every point"
    );
    println!("  metrics.json, history.csv, config.toml");
    println!("For COLMAP, TUM, GLB and NPZ: pba-infer export {}", out.display());
    Ok(())
}

/// Reconstructs a sequence and judges it before and after.
pub fn reconstruct_and_score(
    prior: &Prior,
    sequence: &Sequence,
    config: &BundleAdjustmentConfig,
    backend: Backend,
    observe: &mut dyn FnMut(&Step, &Unknowns),
) -> Result<Reconstruction> {
    let device = backend.device().autodiff();
    let start = Instant::now();
    let (mut history, mut trace) = (Vec::new(), Vec::new());
    let outcome = reconstruct(prior, sequence, config, &device, &mut |step, unknowns| {
        history.push(step.clone());
        trace.push(unknowns.clone());
        observe(step, unknowns);
    });
    let missing = match config.start {
        Start::Regressors => NO_REFERENCE_MASK,
        Start::Truth => "its true poses and points, to start from, are not known",
    };
    let outcome = outcome.with_context(|| format!("{}: {missing}", sequence.name))?;
    let seconds = start.elapsed().as_secs_f64();

    let generator = &prior.shape.generator;
    let shape = outcome.shape(generator);
    let judge = |unknowns: &Unknowns| score(sequence, &shape, unknowns, &device);
    let report = Report {
        initial: judge(&outcome.stages[0].1),
        last: judge(&outcome.unknowns),
        iterations: outcome.iterations,
        seconds,
        n_points: generator.n_points(),
        n_frames: sequence.frames.len(),
        device: backend,
        solver: config.solver,
        status: outcome.status,
        hypotheses: outcome.hypotheses.clone(),
        focal: (!outcome.unknowns.focal().is_empty())
            .then(|| outcome.unknowns.intrinsics(&sequence.intrinsics).focal),
        exposures: outcome.exposures.clone(),
        uncertainty: outcome
            .uncertainty
            .as_ref()
            .map(|found| UncertaintyReport::new(found, sequence, &outcome.unknowns, &device)),
    };
    Ok(Reconstruction { outcome, history, trace, report })
}

fn progress_bar(sequence: &Sequence, config: &BundleAdjustmentConfig) -> ProgressBar {
    let bar = ProgressBar::new(config.n_reports() as u64);
    let style = "{prefix} {bar:30} {pos}/{len} {elapsed_precise} (ETA {eta}) {msg}";
    bar.set_style(ProgressStyle::with_template(style).expect("a valid template"));
    bar.set_prefix(sequence.name.clone());
    bar
}

fn print_summary(report: &Report) {
    let Report { initial, last, .. } = report;
    println!(
        "{} points, {} frames, {} iterations of {:?} on {} in {:.1} s ({:?})",
        report.n_points,
        report.n_frames,
        report.iterations,
        report.solver,
        report.device,
        report.seconds,
        report.status
    );
    println!("{:<44}{:>12}{:>12}", "", "initial", "final");
    for (name, value) in output::ROWS {
        let cell = |scores: &Scores| match value(scores) {
            Some(value) => output::significant(value),
            None => "–".into(),
        };
        println!("{name:<44}{:>12}{:>12}", cell(initial), cell(last));
    }
}
