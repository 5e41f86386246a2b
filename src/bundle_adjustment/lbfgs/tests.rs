//! Standard problems, and what is not one.

use super::*;

/// Problems with minima that are known, and the evaluations that SciPy 1.17.1's L-BFGS-B needs at the
/// settings of [`patient`]: `tests/reference/lbfgs_counts.py` prints them.
const REFERENCE: [(&str, usize); 3] = [("rosenbrock", 45), ("powell", 31), ("quadratic", 556)];
/// Line searches differ; counts that agree this well are of the same method.
const SLACK: f64 = 1.25;

fn patient() -> LbfgsConfig {
    LbfgsConfig {
        max_iterations: 10_000,
        max_evaluations: 10_000,
        history: 10,
        gradient_tolerance: 1e-5,
        relative_tolerance: 0.0,
        first_step: 1.0,
    }
}

fn rosenbrock(x: &[f64]) -> (f64, Vec<f64>) {
    let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
    (a * a + 100.0 * b * b, vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b])
}

/// Powell's singular function: at the minimum, two of four curvatures vanish.
fn powell(x: &[f64]) -> (f64, Vec<f64>) {
    let [a, b] = [x[0] + 10.0 * x[1], x[2] - x[3]];
    let [c, d] = [x[1] - 2.0 * x[2], x[0] - x[3]];
    let value = a * a + 5.0 * b * b + c.powi(4) + 10.0 * d.powi(4);
    let [c3, d3] = [4.0 * c.powi(3), 40.0 * d.powi(3)];
    (value, vec![2.0 * a + d3, 20.0 * a + c3, 10.0 * b - 2.0 * c3, -10.0 * b - d3])
}

/// Curvatures from 1 to 1e4.
fn quadratic(x: &[f64]) -> (f64, Vec<f64>) {
    let scale = |i: usize| 1e4_f64.powf(i as f64 / (x.len() - 1) as f64);
    let gradient: Vec<f64> = x.iter().enumerate().map(|(i, x)| scale(i) * x).collect();
    (0.5 * dot(&gradient, x), gradient)
}

/// Reaches `minimum` to `tolerance`, and does not evaluate more often than the reference does.
#[track_caller]
fn check_minimum(
    name: &str,
    problem: impl Fn(&[f64]) -> (f64, Vec<f64>),
    start: &[f64],
    (minimum, tolerance): (f64, f64),
) {
    let mut count = 0;
    let counted = |x: &[f64]| {
        count += 1;
        problem(x)
    };
    let found = minimise(counted, start, &patient());
    assert!(found.converged, "{found:?}");
    assert!(found.x.iter().all(|x| (x - minimum).abs() < tolerance), "{found:?}");
    let (_, reference) = REFERENCE.into_iter().find(|of| of.0 == name).expect("listed");
    println!("{name}: {count} evaluations, {reference} of the reference");
    assert!(count as f64 <= SLACK * reference as f64, "{name}: {count}, not {reference}");
}

#[test]
fn rosenbrocks_valley_is_followed_to_its_end() {
    check_minimum("rosenbrock", rosenbrock, &[-1.2, 1.0], (1.0, 1e-6));
}

#[test]
fn powells_function_is_solved_as_far_as_its_gradient_tells() {
    check_minimum("powell", powell, &[3.0, -1.0, 0.0, 1.0], (0.0, 1e-2));
}

#[test]
fn an_ill_conditioned_quadratic_is_solved() {
    check_minimum("quadratic", quadratic, &[1.0; 20], (0.0, 1e-5));
}

#[test]
fn a_region_without_values_is_backed_out_of() {
    let barrier = |x: &[f64]| match x[0] > 0.0 {
        true => (x[0] - x[0].ln(), vec![1.0 - 1.0 / x[0]]),
        false => (f64::NAN, vec![f64::NAN]),
    };
    let config = LbfgsConfig { first_step: 10.0, ..patient() };
    let found = minimise(barrier, &[3.0], &config);
    assert!((found.x[0] - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn no_step_is_taken_from_where_there_is_no_value() {
    let found = minimise(|_: &[f64]| (f64::NAN, vec![0.0]), &[2.0], &patient());
    assert_eq!((found.x, found.value), (vec![2.0], f64::INFINITY));
}

#[test]
fn the_budget_of_evaluations_is_kept() {
    let mut count = 0;
    let counted = |x: &[f64]| {
        count += 1;
        rosenbrock(x)
    };
    minimise(counted, &[-1.2, 1.0], &LbfgsConfig { max_evaluations: 7, ..patient() });
    assert_eq!(count, 7);
}

#[test]
fn every_accepted_point_is_lower_than_the_last() {
    struct Followed(Vec<f64>);
    impl Problem for &mut Followed {
        fn evaluate(&mut self, x: &[f64]) -> (f64, Vec<f64>) {
            rosenbrock(x)
        }
        fn accepted(&mut self, sample: &Sample) {
            assert_eq!(sample.value, rosenbrock(&sample.x).0);
            self.0.push(sample.value);
        }
    }
    let mut followed = Followed(Vec::new());
    let found = minimise(&mut followed, &[-1.2, 1.0], &patient());
    assert!(followed.0.is_sorted_by(|before, after| before > after), "{:?}", followed.0);
    assert_eq!(
        (followed.0[0], followed.0.last()),
        (rosenbrock(&[-1.2, 1.0]).0, Some(&found.value))
    );
}

/// Where a jump lies in the way of one direction, as when much of a cloud turns out of sight.
#[test]
fn steepest_descent_goes_on_where_the_remembered_curvature_fails() {
    let mut n_calls = 0;
    let deceived = |x: &[f64]| {
        n_calls += 1;
        let (value, gradient) = quadratic(x);
        // The whole second line search meets nothing that is lower.
        if (3..3 + line_search::MAX_TRIALS).contains(&n_calls) {
            (f64::INFINITY, gradient)
        } else {
            (value, gradient)
        }
    };
    let found = minimise(deceived, &[1.0; 4], &patient());
    assert!(max_abs(&found.x) < 1e-5, "{found:?}");
}
