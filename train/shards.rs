//! `pba-train shards` and `merge`: the regressors' training pictures as WebDataset tars.

use std::path::PathBuf;

use clap::Args;
use object_pba::{
    Error, Result,
    data::formats::webdataset::{Contents, Part, merge_shards},
    training::write_shard,
};

use crate::Arguments;

#[derive(Args)]
pub struct ShardArguments {
    #[command(flatten)]
    arguments: Arguments,
    /// Render part i of n only, say 2/8; parts may be rendered anywhere, in any order.
    #[arg(long, value_name = "I/N", default_value_t = Part::WHOLE)]
    shard: Part,
}

#[derive(Args)]
pub struct MergeArguments {
    /// All tars of the dataset, their manifests beside them.
    #[arg(required = true)]
    tars: Vec<PathBuf>,
    /// Folder for the one tar that a single run would have written.
    #[arg(long)]
    out: PathBuf,
}

/// Renders one part of the training pictures. A finished one is left alone.
pub fn write(ShardArguments { arguments, shard }: &ShardArguments) -> Result<()> {
    report(&write_shard(&arguments.config()?, *shard, &arguments.out)?);
    Ok(())
}

pub fn merge(MergeArguments { tars, out }: &MergeArguments) -> Result<()> {
    std::fs::create_dir_all(out).map_err(Error::io(out))?;
    report(&merge_shards(tars, &out.join(Part::WHOLE.file_name("crops", "tar")))?);
    Ok(())
}

fn report(Contents { samples, total, .. }: &Contents) {
    println!("samples {} to {} of {total}", samples.start, samples.end);
}
