//! The pictures from the front and from the rear: `[x, y]`.

use super::{
    Livery, MARGIN, STRIPE_WIDTH, STRIPES, darker, steps,
    top::{rear_window, windscreen},
};
use crate::data::procedural::{
    canvas::{Canvas, Color, Place, rectangle, superellipse},
    parameters::{BodyStyle, CarParameters},
    profile::Profile,
};

const GAP_WIDTH: f32 = 0.02;
/// Half the size of a number plate, in metres.
const PLATE: Place = [0.26, 0.06];

impl Livery {
    pub(super) fn front(&self, profile: &Profile) -> Canvas {
        let mut canvas = self.blank_end(profile);
        let CarParameters { size, cabin, .. } = profile.parameters;
        self.paint_box(&mut canvas, profile, cabin.height * size.height + 0.02);
        self.paint_bumper(&mut canvas, profile, 0.62 * profile.nose_height);
        self.paint_grille(&mut canvas, profile);
        let (y, half_height) = self.headlamp(profile);
        let outer = profile.parameters.size.width / 2.0;
        for side in [-1.0, 1.0] {
            self.paint_headlamp(&mut canvas, [side, outer], y, half_height);
            let fog_lamp = [side * 0.72 * outer, 0.42 * profile.nose_height];
            canvas.fill(&superellipse(fog_lamp, [0.11, 0.06], 3.0), [0.05; 3]);
            canvas.fill(&superellipse(fog_lamp, [0.045; 2], 2.0), self.lamp);
        }
        self.paint_plate(&mut canvas, 0.50 * profile.nose_height);
        let outline: Vec<Place> = windscreen(profile).iter().map(|&[_, x, y]| [x, y]).collect();
        self.paint_window(&mut canvas, &outline);
        canvas
    }

    pub(super) fn rear(&self, profile: &Profile) -> Canvas {
        let mut canvas = self.blank_end(profile);
        let bumper_top = 0.55 * profile.deck_height;
        self.paint_box(&mut canvas, profile, bumper_top);
        self.paint_bumper(&mut canvas, profile, bumper_top);
        let gap = darker(self.paint, 0.3);
        let outer = profile.parameters.size.width / 2.0;
        let width = 0.86 * outer;
        canvas.trace(&[[-outer, bumper_top], [outer, bumper_top]], GAP_WIDTH, gap);
        let style = profile.parameters.style;
        let upright =
            if style.has_deck() { profile.deck_height } else { profile.parameters.size.height };
        canvas.outline(&rectangle([-width, bumper_top], [width, upright]), GAP_WIDTH, gap);
        if matches!(style, BodyStyle::Van | BodyStyle::BoxTruck) {
            canvas.trace(&[[0.0, bumper_top], [0.0, upright]], GAP_WIDTH, gap);
        }
        self.paint_tail_lamps(&mut canvas, profile);

        let plate_height = 0.68 * profile.deck_height;
        let badge = [0.0, plate_height + 0.15];
        canvas.fill(&superellipse(badge, [0.05; 2], 2.0), self.accent);
        canvas.trace(
            &[[-0.28, plate_height + 0.09], [0.28, plate_height + 0.09]],
            0.025,
            self.accent,
        );
        self.paint_plate(&mut canvas, plate_height);
        for side in [-1.0, 1.0] {
            let exhaust = [side * 0.6 * outer, profile.bottom(profile.rear) + 0.05];
            canvas.fill(&superellipse(exhaust, [0.07, 0.035], 3.0), self.accent);
            canvas.fill(&superellipse(exhaust, [0.05, 0.022], 3.0), [0.02; 3]);
        }
        let outline: Vec<Place> = rear_window(profile).iter().map(|&[_, x, y]| [x, y]).collect();
        if self.has_rear_window(profile) {
            self.paint_window(&mut canvas, &outline);
        }
        canvas
    }

    pub(super) fn has_rear_window(&self, profile: &Profile) -> bool {
        match profile.parameters.style {
            BodyStyle::Van => !self.detail.panel_van,
            style => !matches!(style, BodyStyle::BoxTruck | BodyStyle::Roadster),
        }
    }

    /// Middle and half height of the headlamps, y.
    pub(super) fn headlamp(&self, profile: &Profile) -> (f32, f32) {
        let half_height = self.detail.lamp_height;
        let top = profile.nose_height - 0.6 * profile.parameters.ends.edge_radius;
        (top - half_height - 0.02, half_height)
    }

    /// Lower and upper edge of the tail lamps, y.
    pub(super) fn tail_lamp_heights(&self, profile: &Profile) -> [f32; 2] {
        let top = 0.93 * profile.deck_height * profile.parameters.ends.tail;
        [top - 2.2 * self.detail.lamp_height - 0.04, top]
    }

    fn blank_end(&self, profile: &Profile) -> Canvas {
        let half_width = profile.parameters.size.width / 2.0 + MARGIN;
        let high = [half_width, profile.parameters.size.height + 2.0 * MARGIN];
        let mut canvas = Canvas::new([-half_width, 0.0], high, self.paint);
        let belt = profile.belt(0.0) + 0.05;
        if self.roof != self.paint {
            canvas.fill(&rectangle([-2.0, belt], [2.0, 9.0]), self.roof);
        }
        if self.detail.racing_stripes {
            for x in STRIPES {
                canvas.trace(&[[x, 0.0], [x, 9.0]], STRIPE_WIDTH, self.decal);
            }
        }
        canvas
    }

    /// The walls of a truck's box, above `low`.
    fn paint_box(&self, canvas: &mut Canvas, profile: &Profile, low: f32) {
        if profile.in_box(profile.rear) {
            canvas.fill(&rectangle([-2.0, low], [2.0, 9.0]), self.cargo);
        }
    }

    fn paint_bumper(&self, canvas: &mut Canvas, profile: &Profile, top: f32) {
        let lip = profile.parameters.size.clearance + 0.13;
        if self.detail.plastic_bumpers {
            canvas.fill(&rectangle([-2.0, 0.0], [2.0, top]), self.trim);
        }
        canvas.fill(&rectangle([-2.0, 0.0], [2.0, lip]), self.trim);
    }

    /// A dark opening with bars and a badge, and the air intake below the plate.
    fn paint_grille(&self, canvas: &mut Canvas, profile: &Profile) {
        let (y, lamp_half_height) = self.headlamp(profile);
        let half_width = self.detail.grille_half_width * profile.parameters.size.width / 2.0 + 0.1;
        let half_height = lamp_half_height + 0.03;
        let opening = superellipse([0.0, y - 0.02], [half_width, half_height], 5.0);
        canvas.fill(&opening, [0.03; 3]);
        let bars = steps(
            y - 0.02 - 0.8 * half_height,
            y - 0.02 + 0.8 * half_height,
            self.detail.n_grille_bars,
        );
        for bar in bars {
            canvas.trace(
                &[[-0.92 * half_width, bar], [0.92 * half_width, bar]],
                0.014,
                self.accent,
            );
        }
        canvas.outline(&opening, 0.022, self.accent);
        canvas.fill(&superellipse([0.0, y - 0.02], [0.06; 2], 2.0), self.accent);
        canvas.outline(&superellipse([0.0, y - 0.02], [0.06; 2], 2.0), 0.012, [0.05; 3]);
        let intake = superellipse([0.0, 0.36 * profile.nose_height], [0.5, 0.07], 4.0);
        canvas.fill(&intake, [0.03; 3]);
    }

    fn paint_headlamp(&self, canvas: &mut Canvas, [side, outer]: Place, y: f32, half_height: f32) {
        let inner = self.detail.lamp_inset * outer;
        let outline = if self.detail.round_lamps {
            superellipse([side * (inner + 0.14), y], [0.13, half_height + 0.03], 2.0)
        } else {
            vec![
                [side * inner, y - 0.5 * half_height],
                [side * (outer + 0.1), y - half_height],
                [side * (outer + 0.1), y + half_height],
                [side * inner, y + half_height],
            ]
        };
        canvas.fill(&outline, self.lamp);
        let bulb = superellipse([side * (inner + 0.15), y], [0.7 * half_height; 2], 2.0);
        canvas.outline(&bulb, 0.02, darker(self.lamp, 0.5));
        canvas.outline(&outline, 0.02, [0.08; 3]);
    }

    fn paint_tail_lamps(&self, canvas: &mut Canvas, profile: &Profile) {
        let [low, high] = self.tail_lamp_heights(profile);
        let outer = profile.parameters.size.width / 2.0 + 0.1;
        let inner = (self.detail.lamp_inset + 0.08) * outer;
        if self.detail.light_bar {
            let y = high - 0.04;
            canvas.trace(&[[-outer, y], [outer, y]], 0.05, self.tail_lamp);
        }
        for side in [-1.0, 1.0] {
            let lamp = rectangle([side * inner, low], [side * outer, high]);
            canvas.fill(&lamp, self.tail_lamp);
            let y = low + 0.3 * (high - low);
            canvas.trace(&[[side * inner, y], [side * outer, y]], 0.035, [0.95, 0.75, 0.6]);
            canvas.outline(&lamp, 0.015, [0.1; 3]);
        }
    }

    fn paint_plate(&self, canvas: &mut Canvas, y: f32) {
        let [half_width, half_height] = PLATE;
        let corners = |scale: f32| {
            let [w, h] = [half_width * scale, half_height * scale];
            rectangle([-w, y - h], [w, y + h])
        };
        canvas.fill(&corners(1.1), [0.05; 3]);
        canvas.fill(&corners(1.0), self.plate);
        for x in [-0.19, -0.13, -0.04, 0.02, 0.12, 0.18] {
            canvas.trace(&[[x, y - 0.03], [x + 0.015, y + 0.03]], 0.022, [0.08; 3]);
        }
    }

    fn paint_window(&self, canvas: &mut Canvas, outline: &[Place]) {
        const SEAL: Color = [0.05; 3];
        canvas.outline(outline, 0.05, SEAL);
        canvas.fill(outline, self.glass);
    }
}
