//! Which way an object is turned in its file.

use std::{fmt, str::FromStr};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A direction along an axis: `x`, `+y`, `-z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct SignedAxis {
    /// 0, 1 or 2.
    axis: usize,
    negative: bool,
}

/// Where the object's upper side and its front point to, in the file's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes {
    up: SignedAxis,
    front: SignedAxis,
}

impl SignedAxis {
    const X: Self = Self { axis: 0, negative: false };
    const Y: Self = Self { axis: 1, negative: false };
    const MINUS_Z: Self = Self { axis: 2, negative: true };

    fn direction(self) -> Vector3<f32> {
        let mut direction = Vector3::zeros();
        direction[self.axis] = if self.negative { -1.0 } else { 1.0 };
        direction
    }
}

impl Axes {
    /// Ours, and ShapeNetCore v2's.
    pub const WORLD: Self = Self { up: SignedAxis::Y, front: SignedAxis::MINUS_Z };
    /// ShapeNetCore v1's.
    pub const SHAPENET_V1: Self = Self { up: SignedAxis::Y, front: SignedAxis::X };

    /// Refused if front is up or down.
    pub fn new(up: SignedAxis, front: SignedAxis) -> Result<Self, String> {
        if up.axis == front.axis {
            return Err(format!("up is {up}, so front cannot be {front}"));
        }
        Ok(Self { up, front })
    }

    /// From what is known of them; the rest is as in our world. None if nothing is known.
    pub fn given(
        up: Option<SignedAxis>,
        front: Option<SignedAxis>,
    ) -> Result<Option<Self>, String> {
        if up.is_none() && front.is_none() {
            return Ok(None);
        }
        let Self { up: world_up, front: world_front } = Self::WORLD;
        Self::new(up.unwrap_or(world_up), front.unwrap_or(world_front)).map(Some)
    }

    /// The rotation to our world: up becomes +Y, and front −Z.
    pub fn world_from_file(&self) -> Matrix3<f32> {
        let [up, back] = [self.up.direction(), -self.front.direction()];
        Matrix3::from_columns(&[up.cross(&back), up, back]).transpose()
    }
}

impl FromStr for SignedAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.strip_prefix(['+', '-']).unwrap_or(text);
        let axis = ["x", "y", "z"].iter().position(|axis| name.eq_ignore_ascii_case(axis));
        let axis = axis.ok_or_else(|| format!("{text:?} is not an axis such as y, +y or -z"))?;
        Ok(Self { axis, negative: text.starts_with('-') })
    }
}

impl TryFrom<String> for SignedAxis {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<SignedAxis> for String {
    fn from(axis: SignedAxis) -> Self {
        axis.to_string()
    }
}

impl fmt::Display for SignedAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.negative { "-" } else { "" };
        write!(f, "{sign}{}", ["x", "y", "z"][self.axis])
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "up {}, front {}", self.up, self.front)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(text: &str) -> SignedAxis {
        text.parse().expect("an axis")
    }

    #[test]
    fn every_pair_of_axes_gives_a_rotation_to_the_world() {
        let all = ["x", "y", "z", "-x", "-y", "-z"].map(axis);
        let mut n_pairs = 0;
        for up in all {
            for front in all.into_iter().filter(|front| front.axis != up.axis) {
                let rotation = Axes::new(up, front).expect("not parallel").world_from_file();
                assert_eq!(rotation * up.direction(), Vector3::y());
                assert_eq!(rotation * front.direction(), -Vector3::z());
                assert_eq!(rotation.determinant(), 1.0);
                n_pairs += 1;
            }
        }
        assert_eq!(n_pairs, 24);
    }

    #[test]
    fn parallel_axes_are_refused() {
        assert!(Axes::new(axis("y"), axis("-y")).is_err());
        let refusal = Axes::given(Some(axis("z")), None).unwrap_err();
        assert!(refusal.contains("up is z") && refusal.contains("-z"), "{refusal}");
    }

    #[test]
    fn what_is_not_given_is_as_in_the_world() {
        assert_eq!(Axes::given(None, None), Ok(None));
        assert_eq!(Axes::given(Some(axis("+Y")), None), Ok(Some(Axes::WORLD)));
        assert_eq!(Axes::given(None, Some(axis("x"))), Ok(Some(Axes::SHAPENET_V1)));
    }

    #[test]
    fn axes_are_written_as_they_are_read() {
        for text in ["x", "y", "z", "-x", "-y", "-z"] {
            assert_eq!(axis(text).to_string(), text);
        }
        for text in ["", "w", "xy", "--x", "-", "1"] {
            assert!(text.parse::<SignedAxis>().is_err(), "{text}");
        }
    }
}
