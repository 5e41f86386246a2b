//! What a study leaves on disk.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use object_pba::config::write_config;

use super::{chart, results::Results};

/// Writes the tables, the figure and each arm's effective config into `folder`; the table is returned.
pub fn write(folder: &Path, results: &Results) -> Result<String> {
    let arms = folder.join("arms");
    fs::create_dir_all(&arms).with_context(|| format!("cannot create {}", arms.display()))?;
    for (idx, arm) in results.comparison.arms.iter().enumerate() {
        let name: String = arm
            .name
            .chars()
            .map(|c| if c.is_alphanumeric() || c == '.' { c } else { '_' })
            .collect();
        write_config(&arms.join(format!("{}_{name}.toml", idx + 1)), arm)?;
    }
    let text = results.markdown();
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    write("table.md", &text)?;
    write("table.csv", &results.csv()?)?;
    write("per_sequence.csv", &results.sequences_csv()?)?;
    write("figure.svg", &chart::draw(results)?)?;
    Ok(text)
}
