//! The rows of tables: initial and final states, each over all sequences.

use object_pba::initial_guess::InitialMotion;

use super::{
    measured::Measured,
    methods::Method,
    plan::{Entry, Plan, Task},
    store::MethodResult,
};

/// One state of one method, in every sequence.
pub struct State {
    /// Its name in files.
    pub key: String,
    /// Its name on pages.
    pub label: String,
    /// How many frames it saw, where that is what it is about.
    pub n_views: Option<usize>,
    /// In the order of the sequences; why there is none, where it failed.
    pub scored: Vec<Result<Scored, String>>,
}

#[derive(Clone)]
pub struct Scored {
    pub measured: Measured,
    pub seconds: Option<f64>,
    /// Whether the solver ended in a fault.
    pub faulty: bool,
    pub n_posed: usize,
    pub n_frames: usize,
}

/// The initial state of the chosen solver.
pub const INITIAL: &str = "initial";
/// That of the paper, where it is another one.
pub const INITIAL_STILL: &str = "initial-still";

/// All states of an evaluation, the initial ones first.
pub fn states(plan: &Plan, entries: &[Entry]) -> Vec<State> {
    let solver = Task::Method(Method::Solver);
    let still = plan.context.config.initial_motion == InitialMotion::Still;
    let label = if still { "start, Δp = 0" } else { "start" };
    let mut states = vec![state(INITIAL, label, None, entries, &solver, initial)];
    let paper = plan
        .tasks
        .iter()
        .find(|task| matches!(task, Task::Method(method) if method.starts_still()) && !still);
    states.extend(
        paper.map(|task| state(INITIAL_STILL, "start, Δp = 0", None, entries, task, initial)),
    );
    for task in &plan.tasks {
        let (label, n_views) = match task {
            Task::Method(method) => (method.label(&plan.context.config), None),
            Task::Views(n_views) => {
                let solver = Method::Solver.label(&plan.context.config);
                (format!("{solver}, L = {n_views}"), Some(*n_views))
            }
            Task::Estimates(_) => (task.name(), None),
        };
        states.push(state(&task.name(), &label, n_views, entries, task, last));
    }
    states
}

fn state(
    key: &str,
    label: &str,
    n_views: Option<usize>,
    entries: &[Entry],
    task: &Task,
    read: fn(&MethodResult) -> Option<Scored>,
) -> State {
    let of_entry = |entry: &Entry| match &entry.results[&task.name()] {
        Ok(result) => read(result).ok_or_else(|| "it starts nowhere".into()),
        Err(error) => Err(error.clone()),
    };
    let scored = entries.iter().map(of_entry).collect();
    State { key: key.into(), label: label.into(), n_views, scored }
}

fn initial(result: &MethodResult) -> Option<Scored> {
    let measured = result.initial.clone()?;
    Some(Scored { measured, seconds: None, faulty: false, ..last(result)? })
}

fn last(result: &MethodResult) -> Option<Scored> {
    Some(Scored {
        measured: result.last.clone(),
        seconds: result.seconds,
        faulty: result.status.is_some_and(|status| status.is_fault()),
        n_posed: result.n_posed,
        n_frames: result.n_frames,
    })
}

impl State {
    /// A number of every sequence; `None` where it failed, or has none.
    pub fn values(&self, value: fn(&Measured) -> Option<f64>) -> Vec<Option<f64>> {
        let of = |scored: &Result<Scored, String>| value(&scored.as_ref().ok()?.measured);
        self.scored.iter().map(of).collect()
    }

    pub fn n_failed(&self) -> usize {
        self.scored.iter().filter(|scored| scored.is_err()).count()
    }
}

/// Sequences of one model are named `model-0`, `model-1`, and so on.
pub fn model_of(sequence: &str) -> &str {
    sequence.rsplit_once('-').map_or(sequence, |(model, _)| model)
}
