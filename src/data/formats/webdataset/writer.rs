//! Writes a shard in one step: it is there and whole, or not at all.

use std::{
    fs::{self, File},
    io::{self, BufWriter},
    path::{Path, PathBuf},
    process,
};

use tar::{Builder, Header};

use super::{Contents, EXTENSIONS, Hashed, Manifest, Sample, file_name};
use crate::{Error, Result, data::formats::write_atomically};

/// A shard that is being written. It is given up if it is dropped before it is finished.
pub struct ShardWriter {
    path: PathBuf,
    partial: Partial,
    tar: Builder<Hashed<BufWriter<File>>>,
    contents: Contents,
    next_sample: usize,
}

impl ShardWriter {
    /// Begins the shard that will lie at `path`.
    pub fn create(path: &Path, contents: Contents) -> Result<Self> {
        let partial = Partial(path.with_extension(format!("{}.partial", process::id())));
        let file = File::create(&partial.0).map_err(Error::io(path))?;
        Ok(Self {
            path: path.into(),
            partial,
            tar: Builder::new(Hashed::new(BufWriter::new(file))),
            next_sample: contents.samples.start,
            contents,
        })
    }

    /// Appends the next sample.
    pub fn append(&mut self, sample: &Sample) -> Result<()> {
        for (extension, bytes) in EXTENSIONS.into_iter().zip(&sample.files) {
            let name = file_name(self.next_sample, extension);
            append_file(&mut self.tar, &name, bytes).map_err(Error::io(&self.path))?;
        }
        self.next_sample += 1;
        Ok(())
    }

    /// Puts the tar, then its manifest, in their places. All samples must have been appended.
    pub fn finish(self) -> Result<()> {
        assert_eq!(self.next_sample, self.contents.samples.end, "a shard holds what it says");
        let hashed = self.tar.into_inner().map_err(Error::io(&self.path))?;
        let Hashed { inner, hasher } = hashed;
        let file = inner.into_inner().map_err(io::IntoInnerError::into_error);
        let moved = file.and_then(|_| fs::rename(&self.partial.0, &self.path));
        moved.map_err(Error::io(&self.path))?;

        let sha256 = Hashed { inner: (), hasher }.finish();
        let manifest = Manifest { contents: self.contents, sha256 };
        let mut text = serde_json::to_vec_pretty(&manifest).expect("the fields are plain JSON");
        text.push(b'\n');
        write_atomically(&self.path.with_extension("json"), &text)
    }
}

/// A file without time or owner.
fn append_file(
    tar: &mut Builder<Hashed<BufWriter<File>>>,
    name: &str,
    bytes: &[u8],
) -> io::Result<()> {
    let mut header = Header::new_ustar();
    header.set_size(bytes.len() as u64);
    header.set_mode(0o644);
    header.set_uid(0);
    header.set_gid(0);
    header.set_mtime(0);
    tar.append_data(&mut header, name, bytes)
}

/// A file that is removed unless it was moved away.
struct Partial(PathBuf);

impl Drop for Partial {
    fn drop(&mut self) {
        // There may be nothing to clean up.
        let _ = fs::remove_file(&self.0);
    }
}
