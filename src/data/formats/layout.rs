//! Which layout a sequence has, and reading it whatever it is.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use super::{
    SequenceHints, colmap, nerfstudio, pictures::unusable, plain, r2n2, srn, video, video::Scratch,
};
use crate::{Error, Result, data::sequence::Sequence};

/// How a sequence is laid out. A folder that fits several is the first of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// A `transforms.json`, or another file of that format, at this path.
    Nerfstudio(PathBuf),
    /// A model in this folder, and its pictures.
    Colmap(PathBuf, colmap::Encoding),
    Srn,
    /// Renderings with their metadata in this folder.
    R2n2(PathBuf),
    Video,
    /// Pictures, in this folder below that of the sequence, and masks.
    Plain(PathBuf),
}

/// A sequence as it was found.
#[derive(Clone, Debug)]
pub struct Reading {
    pub sequence: Sequence,
    pub layout: Layout,
    /// What was assumed or changed, and a user should know.
    pub notes: Vec<String>,
}

/// Reads a sequence of any layout: a folder, a `transforms.json` or a video.
pub fn read_sequence(path: &Path, hints: &SequenceHints) -> Result<Reading> {
    let layout = Layout::detect(path)?;
    if let Some(masks) = hints.masks.as_ref().filter(|masks| !masks.exists()) {
        return Err(unusable(masks, "there are no such masks"));
    }
    // Frames of a video lie here until they are loaded.
    let mut scratch = None;
    let mut listing = match &layout {
        Layout::Nerfstudio(file) => nerfstudio::list(file, hints)?,
        Layout::Colmap(model, encoding) => colmap::list(path, model, *encoding, hints)?,
        Layout::Srn => srn::list(path, hints)?,
        Layout::R2n2(folder) => r2n2::list(folder, hints)?,
        Layout::Video => video::list(path, hints, scratch.insert(Scratch::new()?))?,
        Layout::Plain(below) => plain::list(path, below, hints)?,
    };
    // Of a video, only the frames asked for were extracted.
    if layout != Layout::Video {
        listing.select(hints);
    }
    let (sequence, notes) = listing.load(path)?;
    Ok(Reading { sequence, layout, notes })
}

impl Layout {
    /// Finds out from the names of files; the error says what was looked for.
    pub fn detect(path: &Path) -> Result<Self> {
        if video::is_video(path) {
            return Ok(Self::Video);
        }
        if path.is_file() {
            return match path.extension().is_some_and(|extension| extension == "json") {
                true => Ok(Self::Nerfstudio(path.into())),
                false => Err(unusable(path, "it is neither a folder, a .json file nor a video")),
            };
        }
        path.read_dir().map_err(Error::io(path))?;
        let transforms = path.join(nerfstudio::TRANSFORMS);
        if transforms.is_file() {
            return Ok(Self::Nerfstudio(transforms));
        }
        if let Some((model, encoding)) = colmap::find_model(path) {
            return Ok(Self::Colmap(model, encoding));
        }
        if srn::is_srn(path) {
            return Ok(Self::Srn);
        }
        if let Some(folder) = r2n2::find_metadata(path) {
            return Ok(Self::R2n2(folder));
        }
        plain::find_pictures(path)?.map(Self::Plain).ok_or_else(|| {
            let reason = "there is no transforms.json, COLMAP model, SRN folder, 3D-R2N2 rendering or PNG or JPEG picture in it";
            unusable(path, reason)
        })
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Nerfstudio(file) => {
                write!(f, "nerfstudio {}", file.file_name().unwrap_or_default().display())
            }
            Self::Colmap(_, colmap::Encoding::Text) => f.write_str("COLMAP text model"),
            Self::Colmap(_, colmap::Encoding::Binary) => f.write_str("COLMAP binary model"),
            Self::Srn => f.write_str("SRN folder"),
            Self::R2n2(_) => f.write_str("3D-R2N2 renderings"),
            Self::Video => f.write_str("video"),
            Self::Plain(_) => f.write_str("pictures and masks"),
        }
    }
}
