//! Patterns of names.

/// Whether `text` is `pattern`, where each `*` stands for any text.
pub fn matches_pattern(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else { return pattern == text };
    let Some(mut remaining) = text.strip_prefix(start) else { return false };
    let Some((middles, end)) = rest.rsplit_once('*') else { return remaining.ends_with(rest) };
    // The first place where each piece fits leaves the most for the others.
    for piece in middles.split('*') {
        let Some(at) = remaining.find(piece) else { return false };
        remaining = &remaining[at + piece.len()..];
    }
    remaining.ends_with(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_any_text() {
        for (pattern, text) in [
            ("car", "car"),
            ("*", ""),
            ("c*", "car"),
            ("*r", "car"),
            ("c*r", "car"),
            ("*a*", "car"),
            ("a*b*c", "a1b2b3c"),
            ("a**b", "ab"),
        ] {
            assert!(matches_pattern(pattern, text), "{pattern} {text}");
        }
        for (pattern, text) in [
            ("car", "cart"),
            ("", "a"),
            ("c*", "acr"),
            ("ab*ba", "aba"),
            ("a*b*b", "ab"),
            ("*x*", "car"),
        ] {
            assert!(!matches_pattern(pattern, text), "{pattern} {text}");
        }
    }
}
