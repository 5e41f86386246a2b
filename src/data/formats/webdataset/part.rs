//! Which part of a job is to be done here.

use std::{fmt, ops::Range, str::FromStr};

/// One of equal parts of a job, written `2/8`: the second of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// From 1 to `count`.
    index: u32,
    count: u32,
}

impl Part {
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// This part of `n_items` in a row. All parts together hold each item once.
    pub fn range(self, n_items: usize) -> Range<usize> {
        let start_of = |index: u32| n_items * index as usize / self.count as usize;
        start_of(self.index - 1)..start_of(self.index)
    }

    /// What its file is called, say `crops-0002-of-0008.tar`.
    pub fn file_name(self, stem: &str, extension: &str) -> String {
        format!("{stem}-{:04}-of-{:04}.{extension}", self.index, self.count)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').map(|(index, count)| (index.parse(), count.parse()));
        match numbers {
            Some((Ok(index), Ok(count))) if 1 <= index && index <= count => {
                Ok(Self { index, count })
            }
            _ => Err("a part is written i/n, from 1/n to n/n".into()),
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_each_item_once_in_order() {
        for (n_items, count) in [(0, 3), (2, 5), (7, 3), (8, 4), (1, 1)] {
            let parts = (1..=count).map(|index| Part { index, count });
            let items: Vec<_> = parts.flat_map(|part| part.range(n_items)).collect();
            assert_eq!(items, Vec::from_iter(0..n_items), "{n_items} in {count}");
        }
    }

    #[test]
    fn a_part_reads_as_it_is_written() {
        assert_eq!("2/8".parse(), Ok(Part { index: 2, count: 8 }));
        assert_eq!(Part { index: 2, count: 8 }.to_string(), "2/8");
        for text in ["", "1", "0/2", "3/2", "1/0", "a/b", "-1/2", "1/2/3"] {
            assert!(text.parse::<Part>().is_err(), "{text}");
        }
    }
}
