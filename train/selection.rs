//! Which meshes a command takes.

use clap::Args;
use object_pba::data::collection::{Axes, Selection, SignedAxis, Split};

/// Which models of a folder to take, and how they are turned.
#[derive(Args, Default)]
pub struct SelectionArguments {
    /// Category of ShapeNet; several with commas, or by repetition.
    #[arg(long, value_delimiter = ',')]
    pub synset: Vec<String>,
    /// Only this part of ShapeNet, by its all.csv.
    #[arg(long)]
    pub split: Option<Split>,
    /// Where models of a plain folder have their upper side: y, unless said otherwise.
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub up: Option<SignedAxis>,
    /// And their front: -z, unless said otherwise.
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub front: Option<SignedAxis>,
    /// Take only model ids like this, `*` standing for anything; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    pub include: Vec<String>,
    /// Leave out model ids like this; may be repeated.
    #[arg(long, value_name = "PATTERN")]
    pub exclude: Vec<String>,
}

impl SelectionArguments {
    /// The selection, or why it makes no sense. Without `--synset`, it has the given ones.
    pub fn selection(&self, default_synsets: &[&str]) -> Result<Selection, String> {
        let given = self.synset.clone();
        let default = || default_synsets.iter().map(|synset| (*synset).to_owned()).collect();
        Ok(Selection {
            axes: Axes::given(self.up, self.front)?,
            synsets: if given.is_empty() { default() } else { given },
            split: self.split,
            include: self.include.clone(),
            exclude: self.exclude.clone(),
        })
    }
}
