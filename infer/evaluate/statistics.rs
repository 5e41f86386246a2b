//! Numbers of many sequences.

use serde::Serialize;

/// A number over the sequences that have it. `None` of none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    pub n: usize,
    pub mean: Option<f64>,
    pub median: Option<f64>,
    pub lower_quartile: Option<f64>,
    pub upper_quartile: Option<f64>,
}

impl Statistic {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        Self {
            n: values.len(),
            mean: mean(&values),
            median: quantile(&values, 0.5),
            lower_quartile: quantile(&values, 0.25),
            upper_quartile: quantile(&values, 0.75),
        }
    }
}

pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Of sorted values, a line between those that are next to it.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share * last as f64;
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    Some(sorted[below] + (sorted[above] - sorted[below]) * place.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_lie_between_their_neighbours() {
        let statistic = Statistic::of([4.0, 1.0, 2.0, 10.0]);
        assert_eq!((statistic.n, statistic.mean, statistic.median), (4, Some(4.25), Some(3.0)));
        assert_eq!((statistic.lower_quartile, statistic.upper_quartile), (Some(1.75), Some(5.5)));
        assert_eq!(Statistic::of([]).median, None);
    }
}
