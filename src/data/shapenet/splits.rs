//! `all.csv`: which split each model belongs to.

use std::{collections::HashMap, path::Path};

use serde::Deserialize;

use crate::{Error, Result, data::collection::Split};

/// Which split each model is in, by synset and id.
pub struct Splits(HashMap<(String, String), Split>);

/// A line of `all.csv`: `id,synsetId,subSynsetId,modelId,split`.
#[derive(Deserialize)]
struct SplitRow {
    #[serde(rename = "synsetId")]
    synset: String,
    #[serde(rename = "modelId")]
    id: String,
    split: Split,
}

impl Splits {
    /// Reads `all.csv` in the tree's root, or beside the one synset that is all there is of it.
    pub fn read(root: &Path) -> Result<Self> {
        let beside = root.parent().unwrap_or(root).join("all.csv");
        let path = Some(root.join("all.csv")).filter(|path| path.is_file()).unwrap_or(beside);
        let invalid =
            |error: csv::Error| Error::Collection { path: path.clone(), reason: error.to_string() };
        let mut file = csv::Reader::from_path(&path).map_err(invalid)?;
        let rows = file.deserialize().map(|row| {
            let SplitRow { synset, id, split } = row.map_err(invalid)?;
            Ok(((bare_number(&synset), id), split))
        });
        rows.collect::<Result<_>>().map(Self)
    }

    pub fn of(&self, synset: &str, id: &str) -> Option<Split> {
        self.0.get(&(bare_number(synset), id.into())).copied()
    }
}

/// Spreadsheets drop a synset's leading zeros.
fn bare_number(synset: &str) -> String {
    synset.trim_start_matches('0').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::shapenet::{CARS, find_models};
    use std::fs;

    /// The models of a split, of whose folders nothing but the name counts here.
    fn ids(root: &Path, split: Split) -> Vec<String> {
        let models = find_models(root, &[], Some(split)).expect("a tree");
        models.into_iter().map(|model| model.id).collect()
    }

    #[test]
    fn splits_follow_all_csv() {
        let root = tempfile::tempdir().expect("a temporary folder");
        for id in ["a", "b", "c", "unlisted"] {
            fs::create_dir_all(root.path().join(CARS).join(id)).expect("writable");
        }
        let header = "id,synsetId,subSynsetId,modelId,split\n";
        let rows = "1,02958343,02958343,a,train\n2,2958343,2958343,b,val\n3,02958343,0,c,test\n\
            4,03001627,0,a,test\n";
        let path = root.path().join("all.csv");
        fs::write(&path, format!("{header}{rows}")).expect("writable");
        for root in [root.path(), &root.path().join(CARS)] {
            assert_eq!(ids(root, Split::Train), ["a"]);
            assert_eq!(ids(root, Split::Val), ["b"]);
            assert_eq!(ids(root, Split::Test), ["c"]);
        }

        fs::write(&path, format!("{header}{rows}5,02958343,0,d,tset\n")).expect("writable");
        let error = find_models(root.path(), &[], Some(Split::Test)).unwrap_err().to_string();
        assert!(error.contains("all.csv") && error.contains("line: 6"), "{error}");
        fs::remove_file(&path).expect("it is there");
        let error = find_models(root.path(), &[], Some(Split::Test)).unwrap_err().to_string();
        assert!(error.contains("all.csv"), "{error}");
    }
}
