//! Names in the order in which people count: `frame_2` before `frame_10`.

use std::cmp::Ordering;

/// Compares runs of digits as numbers, and everything else letter by letter.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let ordered = pieces(a).cmp(pieces(b));
    // `01` and `1` count alike; some order there must be.
    ordered.then_with(|| a.cmp(b))
}

#[derive(Debug, Eq, Ord, PartialEq, PartialOrd)]
enum Piece<'a> {
    /// The number of its digits without leading zeros, and those digits.
    Number(usize, &'a str),
    Letter(char),
}

fn pieces(mut text: &str) -> impl Iterator<Item = Piece<'_>> {
    std::iter::from_fn(move || {
        let first = text.chars().next()?;
        let n_digits = text.bytes().take_while(u8::is_ascii_digit).count();
        let (head, tail) = text.split_at(n_digits.max(first.len_utf8()));
        text = tail;
        let digits = head.trim_start_matches('0');
        Some(if n_digits > 0 { Piece::Number(digits.len(), digits) } else { Piece::Letter(first) })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_and_letters_spell() {
        let mut names =
            ["b1", "a10", "a2", "a02x", "a", "a2/9", "a2/10", "99999999999999999999999"];
        names.sort_by(|a, b| natural_order(a, b));
        let sorted = ["99999999999999999999999", "a", "a2", "a2/9", "a2/10", "a02x", "a10", "b1"];
        assert_eq!(names, sorted);
        assert_eq!(natural_order("1", "01"), Ordering::Greater);
        assert_eq!(natural_order("1", "1"), Ordering::Equal);
    }
}
