//! Videos, through the system's `ffmpeg`.

use std::{
    env, fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    process::{self, Command},
    sync::atomic::{AtomicUsize, Ordering},
};

use super::{
    hints::SequenceHints,
    listing::{Listing, Shot},
    masks::{MaskSource, mask_in},
    pictures::{self, pictures_in, unusable},
};
use crate::{Error, Result};

/// Endings of the files that we hand to ffmpeg.
const EXTENSIONS: [&str; 7] = ["mp4", "mov", "m4v", "mkv", "webm", "avi", "mpg"];

/// Whether a file is a video, by its ending.
pub fn is_video(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    path.is_file() && EXTENSIONS.contains(&extension.as_str())
}

/// Extracts the frames that are asked for into `scratch` and lists them as `frame_000042.png`, counted
/// from 0 in the video.
///
/// The masks are the alpha channel, a second video, or a folder of pictures named like the frames.
pub(super) fn list(path: &Path, hints: &SequenceHints, scratch: &Scratch) -> Result<Listing> {
    let frames = extract(path, hints, &scratch.0.join("frames"))?;
    let mask_frames = match &hints.masks {
        Some(masks) if !masks.is_dir() => Some(extract(masks, hints, &scratch.0.join("masks"))?),
        _ => None,
    };
    if mask_frames.as_ref().is_some_and(|masks| masks.len() != frames.len()) {
        return Err(unusable(path, "the video of its masks has another number of frames"));
    }
    if let (None, Some(first)) = (&hints.masks, frames.first())
        && !pictures::has_alpha(first)?
    {
        let reason = "it has no alpha channel; give its masks by --masks, a video or a folder of frame_000000.png and so on";
        return Err(unusable(path, reason));
    }
    let mut taken = (0..).filter(|&idx| hints.selects(idx));
    let mut shots = vec![];
    for (idx, path_of_frame) in frames.into_iter().enumerate() {
        let name = PathBuf::from(format!("frame_{:06}.png", taken.next().unwrap_or(idx)));
        let size = pictures::size(&path_of_frame, false)?;
        let missing =
            || "a video does not tell its focal length; give --focal or --fov".to_string();
        let calibration = hints.calibration(size).and_then(|given| given.ok_or_else(missing));
        shots.push(Shot {
            path: path_of_frame,
            upright: false,
            mask: match (&mask_frames, &hints.masks) {
                (Some(masks), _) => MaskSource::File(masks[idx].clone()),
                (None, Some(folder)) => mask_in(folder, &name),
                (None, None) => MaskSource::Alpha,
            },
            name,
            calibration: calibration.map_err(|reason| unusable(path, &reason))?,
            size,
            camera_from_world: None,
        });
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Listing { name, shots, ..Listing::default() })
}

/// Writes the frames asked for as PNGs, and lists them in order.
fn extract(video: &Path, hints: &SequenceHints, folder: &Path) -> Result<Vec<PathBuf>> {
    fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let mut command = Command::new("ffmpeg");
    command.args(["-nostdin", "-v", "error", "-i"]).arg(video);
    // Even time stamps: else ffmpeg doubles and drops frames to keep a constant rate.
    command.args(["-vf", &format!("select='{}',setpts=N/25/TB", selection(hints)), "-r", "25"]);
    if let Some(most) = hints.max_frames {
        command.args(["-frames:v", &most.to_string()]);
    }
    let output = command.arg(folder.join("%06d.png")).output().map_err(|error| {
        let reason = match error.kind() {
            ErrorKind::NotFound => "videos need the program ffmpeg, which is not installed; install it, or extract the frames into a folder".into(),
            _ => format!("ffmpeg does not start: {error}"),
        };
        unusable(video, &reason)
    })?;
    if !output.status.success() {
        let message = String::from_utf8_lossy(&output.stderr);
        let line = message.lines().last().unwrap_or("it says nothing").to_string();
        return Err(unusable(video, &format!("ffmpeg cannot read it: {line}")));
    }
    pictures_in(folder)
}

/// ffmpeg's expression for the frames that the hints select.
fn selection(hints: &SequenceHints) -> String {
    let start = hints.frames.as_ref().map_or(0, |frames| frames.start);
    let every = hints.every.max(1);
    let mut expression = format!("gte(n,{start})*not(mod(n-{start},{every}))");
    if let Some(frames) = &hints.frames {
        expression += &format!("*lt(n,{})", frames.end);
    }
    expression
}

/// A temporary folder that goes with its owner.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new() -> Result<Self> {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        loop {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let path = env::temp_dir().join(format!("object-pba-{}-{count}", process::id()));
            match fs::create_dir(&path) {
                // Left behind by a process of the same number.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => (),
                Err(error) => return Err(Error::io(&path)(error)),
                Ok(()) => return Ok(Self(path)),
            }
        }
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Nothing can be done about a temporary folder that will not go.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selections_are_ffmpeg_s() {
        let all = SequenceHints::default();
        assert_eq!(selection(&all), "gte(n,0)*not(mod(n-0,1))");
        let some = SequenceHints { frames: Some(10..40), every: 3, ..all };
        assert_eq!(selection(&some), "gte(n,10)*not(mod(n-10,3))*lt(n,40)");
    }

    #[test]
    fn scratch_folders_go_with_their_owner() {
        let scratch = Scratch::new().expect("it is writable");
        let path = scratch.0.clone();
        assert!(path.is_dir());
        drop(scratch);
        assert!(!path.exists());
    }
}
