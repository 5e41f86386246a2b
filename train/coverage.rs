//! `pba-train coverage`: how far real cars are from the procedural family.

mod contact_sheet;

use std::{fs, path::PathBuf};

use clap::Args;
use indicatif::{ParallelProgressIterator, ProgressStyle};
use nalgebra::Point3;
use object_pba::{
    Error, Result,
    data::{
        collection::{Collection, Model},
        keyed_rng,
        mesh::Mesh,
        procedural,
        shapenet::CARS,
        surface::sample_surface,
    },
    metrics::style_error,
    nearest_neighbours::nearest_neighbours,
};
use rayon::prelude::*;
use serde::Serialize;

use self::contact_sheet::write_contact_sheet;
use crate::selection::SelectionArguments;

/// Cars on the contact sheet of the family.
const N_SHOWN: usize = 48;

/// What random streams are for: the first half of their keys.
const REAL: u64 = 0;
const REAL_AGAIN: u64 = 1;
const PROCEDURAL: u64 = 2;

/// What to compare, and where to.
#[derive(Args)]
pub struct CoverageArguments {
    /// Folder of meshes: ShapeNetCore v1 or v2, or any.
    #[arg(long, alias = "shapenet")]
    meshes: PathBuf,
    #[command(flatten)]
    selection: SelectionArguments,
    /// How many procedural cars to look among.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u64).range(1..))]
    models: u64,
    /// Points that are drawn from each surface.
    #[arg(long, default_value_t = 2048, value_parser = clap::value_parser!(u32).range(1..))]
    points: u32,
    /// The first car's seed; the others follow. Draws the points as well.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for coverage.json, coverage.png (each mesh, then its nearest car) and family.png.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Distances of all meshes, in squared world units (diagonal 1).
#[derive(Serialize)]
struct Coverage {
    models: u64,
    points: u32,
    seed: u64,
    mean_chamfer: f64,
    mean_from_mesh: f64,
    mean_noise_floor: f64,
    meshes: Vec<Nearest>,
}

/// A mesh and the procedural car that comes nearest to it.
#[derive(Serialize)]
struct Nearest {
    id: String,
    car_seed: u64,
    /// Eq. 7 between the two.
    chamfer: f64,
    /// Its half from the mesh to the car: what the car lacks. The other half is what the mesh lacks,
    /// often a floor.
    from_mesh: f64,
    /// Eq. 7 between two samplings of the mesh itself.
    noise_floor: f64,
}

struct RealCar {
    id: String,
    mesh: Mesh,
    points: Vec<[f32; 3]>,
    noise_floor: f64,
}

pub fn coverage(arguments: &CoverageArguments) -> Result<()> {
    let real_cars = real_cars(arguments)?;
    let coverage = measure(arguments, &real_cars);
    print_table(&coverage);
    if let Some(out) = &arguments.out {
        fs::create_dir_all(out).map_err(Error::io(out))?;
        let path = out.join("coverage.json");
        let text = serde_json::to_string_pretty(&coverage).expect("a table of numbers");
        fs::write(&path, text).map_err(Error::io(&path))?;

        let pairs = real_cars.into_iter().zip(&coverage.meshes);
        let pairs = pairs.flat_map(|(real, found)| [real.mesh, procedural::car(found.car_seed)]);
        write_contact_sheet(&out.join("coverage.png"), &pairs.collect::<Vec<_>>(), 6)?;
        let family: Vec<_> = seeds(arguments).take(N_SHOWN).map(procedural::car).collect();
        write_contact_sheet(&out.join("family.png"), &family, 8)?;
    }
    Ok(())
}

fn real_cars(arguments: &CoverageArguments) -> Result<Vec<RealCar>> {
    let root = &arguments.meshes;
    let selection = arguments.selection.selection(&[CARS]);
    let selection = selection.map_err(|reason| Error::Config { path: root.clone(), reason })?;
    let models = Collection::open(root, &selection)?.models;
    let load = |(idx, model): (usize, Model)| {
        let mesh = model.load()?.mesh;
        let [points, again] =
            [REAL, REAL_AGAIN].map(|stream| cloud(&mesh, arguments, [stream, idx as u64]));
        let noise_floor = style_error(&points, &again);
        Ok(RealCar { id: model.id, mesh, points, noise_floor })
    };
    models.into_iter().enumerate().map(load).collect()
}

/// Compares every car with every mesh, exhaustively.
fn measure(arguments: &CoverageArguments, real_cars: &[RealCar]) -> Coverage {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} cars (ETA {eta})");
    let seeds: Vec<u64> = seeds(arguments).collect();
    let distances: Vec<(u64, Vec<f64>)> = seeds
        .par_iter()
        .progress_with_style(style.expect("a valid template"))
        .map(|&seed| {
            let points = car_cloud(arguments, seed);
            (seed, real_cars.iter().map(|real| style_error(&points, &real.points)).collect())
        })
        .collect();

    let nearest = |(idx, real): (usize, &RealCar)| {
        let of_mesh = distances.iter().map(|(seed, distances)| (*seed, distances[idx]));
        let (car_seed, chamfer) =
            of_mesh.min_by(|a, b| a.1.total_cmp(&b.1)).expect("at least one car");
        Nearest {
            id: real.id.clone(),
            car_seed,
            chamfer,
            from_mesh: mean_squared_distance(&real.points, &car_cloud(arguments, car_seed)),
            noise_floor: real.noise_floor,
        }
    };
    let meshes: Vec<Nearest> = real_cars.iter().enumerate().map(nearest).collect();
    let mean =
        |value: fn(&Nearest) -> f64| meshes.iter().map(value).sum::<f64>() / meshes.len() as f64;
    Coverage {
        models: arguments.models,
        points: arguments.points,
        seed: arguments.seed,
        mean_chamfer: mean(|nearest| nearest.chamfer),
        mean_from_mesh: mean(|nearest| nearest.from_mesh),
        mean_noise_floor: mean(|nearest| nearest.noise_floor),
        meshes,
    }
}

fn print_table(coverage: &Coverage) {
    let Coverage { models, points, .. } = coverage;
    println!("Chamfer to the nearest of {models} procedural cars, 1e-3 at {points} points");
    println!("{:28} {:>9} {:>9} {:>9} {:>9}", "mesh", "nearest", "from mesh", "floor", "car");
    let row = |id: &str, distances: [f64; 3], car: &str| {
        let [nearest, from_mesh, floor] = distances.map(|distance| distance * 1e3);
        println!("{id:28} {nearest:9.3} {from_mesh:9.3} {floor:9.3} {car:>9}");
    };
    for Nearest { id, car_seed, chamfer, from_mesh, noise_floor } in &coverage.meshes {
        row(id, [*chamfer, *from_mesh, *noise_floor], &car_seed.to_string());
    }
    let Coverage { mean_chamfer, mean_from_mesh, mean_noise_floor, .. } = *coverage;
    row("mean", [mean_chamfer, mean_from_mesh, mean_noise_floor], "");
}

/// The half of Eq. 7 that goes one way.
fn mean_squared_distance(from: &[[f32; 3]], to: &[[f32; 3]]) -> f64 {
    let squared = from.iter().zip(nearest_neighbours(from, to)).map(|(&from, nearest)| {
        let offset = Point3::from(from) - Point3::from(to[nearest as usize]);
        f64::from(offset.norm_squared())
    });
    squared.sum::<f64>() / from.len() as f64
}

fn seeds(arguments: &CoverageArguments) -> std::ops::Range<u64> {
    arguments.seed..arguments.seed + arguments.models
}

/// The same points whenever it is asked for.
fn car_cloud(arguments: &CoverageArguments, seed: u64) -> Vec<[f32; 3]> {
    cloud(&procedural::car(seed), arguments, [PROCEDURAL, seed])
}

fn cloud(mesh: &Mesh, arguments: &CoverageArguments, key: [u64; 2]) -> Vec<[f32; 3]> {
    let points =
        sample_surface(mesh, arguments.points as usize, &mut keyed_rng(arguments.seed, key));
    points.into_iter().map(|point| point.coords.into()).collect()
}
