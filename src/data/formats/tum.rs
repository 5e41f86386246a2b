//! Trajectories as the TUM RGB-D benchmark and its tools (evo) read them.

use std::{fmt::Write, path::Path};

use super::{Trajectory, axes, write_atomically};
use crate::Result;

/// Writes `timestamp tx ty tz qx qy qz qw` a line: where each camera stands in the world. The number
/// of the frame is its time.
pub fn write(path: &Path, trajectory: &Trajectory) -> Result<()> {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for (idx, pose) in trajectory.camera_from_world.iter().enumerate() {
        let [x, y, z, i, j, k, w] = axes::to_tum(pose);
        writeln!(text, "{idx} {x} {y} {z} {i} {j} {k} {w}").expect("a string grows");
    }
    write_atomically(path, text.as_bytes())
}
