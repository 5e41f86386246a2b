//! The picture from above: `[z, x]`.

use super::{Livery, MARGIN, STRIPE_WIDTH, STRIPES, darker, steps};
use crate::data::procedural::{
    canvas::{Canvas, Place, rectangle, superellipse},
    parameters::BodyStyle,
    profile::Profile,
};

const GAP_WIDTH: f32 = 0.02;

impl Livery {
    pub(super) fn top(&self, profile: &Profile) -> Canvas {
        let half_width = profile.parameters.size.width / 2.0 + MARGIN;
        let mut canvas = Canvas::new(
            [profile.front - MARGIN, -half_width],
            [profile.rear + MARGIN, half_width],
            self.paint,
        );
        self.paint_upper_body(&mut canvas, profile);
        self.paint_bonnet(&mut canvas, profile);
        self.paint_deck(&mut canvas, profile);
        if profile.in_box(profile.rear) {
            let wall = profile.roof_end - 0.05;
            canvas.fill(&rectangle([wall, -2.0], [profile.rear + 1.0, 2.0]), self.cargo);
        }
        let rear_window = Some(rear_window(profile)).filter(|_| self.has_rear_window(profile));
        for window in [windscreen(profile)].into_iter().chain(rear_window) {
            let outline: Vec<Place> = window.iter().map(|&[z, x, _]| [z, x]).collect();
            canvas.outline(&outline, 0.05, [0.05; 3]);
            canvas.fill(&outline, self.glass);
        }
        // Wipers rest along the lower edge of the windscreen.
        let wiper_z = profile.cowl + 0.10;
        for x in [-0.1, 0.45] {
            canvas.trace(&[[wiper_z, x], [wiper_z + 0.06, x - 0.5]], 0.025, [0.04; 3]);
        }
        canvas
    }

    fn paint_upper_body(&self, canvas: &mut Canvas, profile: &Profile) {
        let [start, end] = [profile.cowl, profile.deck_start];
        canvas.fill(&rectangle([start, -2.0], [end, 2.0]), self.roof);
        if self.detail.racing_stripes {
            for x in STRIPES {
                canvas.trace(&[[profile.front, x], [profile.rear, x]], STRIPE_WIDTH, self.decal);
            }
        }
        let (front, rear) = (profile.roof_start + 0.12, profile.roof_end - 0.1);
        for x in [-1.0, 1.0].map(|side| side * (profile.shoulder(0.0) - 0.13)) {
            canvas.trace(&[[front, x], [rear, x]], GAP_WIDTH, darker(self.roof, 0.6));
        }
        if self.detail.sun_roof {
            let end = (front + 0.75).min(rear);
            canvas.fill(&rectangle([front, -0.4], [end, 0.4]), darker(self.glass, 1.2));
        }
        if matches!(profile.parameters.style, BodyStyle::Van | BodyStyle::Bus) {
            for z in steps(front + 0.2, rear, 6) {
                canvas.trace(&[[z, -0.55], [z, 0.55]], 0.03, darker(self.roof, 0.8));
            }
        }
    }

    /// Shut lines, two creases, and washer jets.
    fn paint_bonnet(&self, canvas: &mut Canvas, profile: &Profile) {
        let gap = darker(self.paint, 0.3);
        let [nose, cowl] = [profile.front + 0.14, profile.cowl - 0.02];
        for side in [-1.0, 1.0] {
            let edge = |z: f32| [z, side * (profile.half_width(z) - 0.13)];
            let shut_line: Vec<_> = steps(nose, cowl, 8).map(edge).collect();
            canvas.trace(&shut_line, GAP_WIDTH, gap);
            let crease = [[nose, side * 0.28], [cowl, side * 0.5]];
            canvas.trace(&crease, 0.04, darker(self.paint, 0.8));
            let jet = superellipse([cowl - 0.08, side * 0.3], [0.02, 0.03], 2.0);
            canvas.fill(&jet, [0.05; 3]);
        }
        let width = profile.half_width(cowl) - 0.08;
        canvas.fill(&rectangle([cowl, -width], [profile.cowl + 0.07, width]), [0.07; 3]);
        let width = profile.half_width(nose) - 0.13;
        canvas.trace(&[[nose, -width], [nose, width]], GAP_WIDTH, gap);
    }

    /// The shut lines of the boot lid, or the floor of the bed.
    fn paint_deck(&self, canvas: &mut Canvas, profile: &Profile) {
        let [start, end] = [profile.deck_start + 0.06, profile.rear - 0.06];
        if !profile.parameters.style.has_deck() || profile.bed().is_some() || end - start < 0.15 {
            return;
        }
        let width = profile.shoulder(start) - 0.12;
        let lid = rectangle([start, -width], [end, width]);
        canvas.outline(&lid, GAP_WIDTH, darker(self.paint, 0.3));
    }
}

/// Outline of the windscreen, `[z, x, y]`.
pub(super) fn windscreen(profile: &Profile) -> Vec<[f32; 3]> {
    slanted_window(profile, profile.cowl, profile.roof_start)
}

/// Outline of the rear window, `[z, x, y]`.
pub(super) fn rear_window(profile: &Profile) -> Vec<[f32; 3]> {
    slanted_window(profile, profile.roof_end, profile.deck_start)
}

fn slanted_window(profile: &Profile, start: f32, end: f32) -> Vec<[f32; 3]> {
    let margin = 0.09 * (end - start);
    let walk = steps(start + margin, end - margin, 8);
    let corner = |z: f32, side: f32| [z, side * (profile.shoulder(z) - 0.12), profile.top(z)];
    let right = walk.clone().map(|z| corner(z, 1.0));
    right.chain(walk.rev().map(|z| corner(z, -1.0))).collect()
}
