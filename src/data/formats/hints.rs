//! What a user may add to what the files of a sequence say.

use std::{ops::Range, path::PathBuf};

use super::calibration::Calibration;

/// Hints for [`read_sequence`](super::read_sequence); the default adds nothing and takes every frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SequenceHints {
    /// Focal length in pixels, of pictures whose files state no camera.
    pub focal: Option<f64>,
    /// Field of view across the width, in degrees, instead of a focal length.
    pub field_of_view: Option<f64>,
    /// A folder of masks, or the video of masks that goes with a video.
    pub masks: Option<PathBuf>,
    /// The frames to take, counted from 0 in the natural order of their names.
    pub frames: Option<Range<usize>>,
    /// Takes every n-th of them; 0 means the same as 1.
    pub every: usize,
    /// Stops after so many.
    pub max_frames: Option<usize>,
}

impl SequenceHints {
    /// Whether to take this frame, but for `max_frames`.
    pub(super) fn selects(&self, frame_idx: usize) -> bool {
        let Range { start, end } = self.frames.clone().unwrap_or(0..usize::MAX);
        (start..end).contains(&frame_idx) && (frame_idx - start).is_multiple_of(self.every.max(1))
    }

    /// A pinhole for pictures of this size, if a focal length or field of view is given.
    pub(super) fn calibration(&self, size: [usize; 2]) -> Result<Option<Calibration>, String> {
        let of_view = self.field_of_view.map(|degrees| {
            let half = 0.5 * degrees.to_radians();
            // Half a turn and more would need a negative focal length, or none.
            if degrees < 180.0 { 0.5 * size[0] as f64 / half.tan() } else { f64::NAN }
        });
        self.focal.or(of_view).map(|focal| Calibration::centered(focal, size)).transpose()
    }

    /// Refuses a focal length for files that state their own.
    pub(super) fn refuse_focal(&self) -> Result<(), String> {
        match self.focal.or(self.field_of_view) {
            Some(_) => Err("it states its own camera; leave out --focal and --fov".into()),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_angle_sees_half_the_width_at_its_distance() {
        let hints = SequenceHints { field_of_view: Some(90.0), ..SequenceHints::default() };
        let camera = hints.calibration([600, 450]).expect("it is a camera").expect("it is given");
        assert!((camera.intrinsics.focal[0] - 300.0).abs() < 1e-3);
        assert_eq!(camera.intrinsics.center, [300.0, 225.0]);
    }

    #[test]
    fn impossible_cameras_are_refused() {
        for degrees in [-10.0, 0.0, 180.0, 400.0, f64::NAN] {
            let hints = SequenceHints { field_of_view: Some(degrees), ..SequenceHints::default() };
            assert!(hints.calibration([10, 10]).is_err(), "{degrees}");
        }
        assert_eq!(SequenceHints::default().calibration([10, 10]), Ok(None));
    }

    #[test]
    fn every_counts_from_the_first_frame_taken() {
        let hints = SequenceHints { frames: Some(3..9), every: 2, ..SequenceHints::default() };
        let taken: Vec<usize> = (0..20).filter(|&idx| hints.selects(idx)).collect();
        assert_eq!(taken, [3, 5, 7]);
    }
}
