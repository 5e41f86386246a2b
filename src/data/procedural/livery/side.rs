//! The picture of both sides: `[z, y]`.

use super::{Livery, MARGIN, darker, doors::Doors, steps};
use crate::data::procedural::{
    canvas::{Canvas, Color, Place, rectangle, superellipse},
    parameters::BodyStyle,
    profile::Profile,
};

/// Height of the frame above the side windows, in metres.
const ROOF_FRAME: f32 = 0.09;
const GAP_WIDTH: f32 = 0.018;

impl Livery {
    pub(super) fn side(&self, profile: &Profile) -> Canvas {
        let height = profile.parameters.size.height;
        let mut canvas = Canvas::new(
            [profile.front - MARGIN, 0.0],
            [profile.rear + MARGIN, height + 2.0 * MARGIN],
            self.paint,
        );
        let doors = Doors::of(profile);
        self.paint_roof(&mut canvas, profile);
        self.paint_decals(&mut canvas, profile, &doors);
        self.paint_lower_side(&mut canvas, profile);
        self.paint_gaps(&mut canvas, profile, &doors);
        self.paint_windows(&mut canvas, profile, &doors);
        self.paint_lamps(&mut canvas, profile);
        canvas
    }

    fn paint_roof(&self, canvas: &mut Canvas, profile: &Profile) {
        let walk = steps(profile.front, profile.rear, 24);
        let upper: Vec<Place> = walk.clone().map(|z| [z, profile.belt(z) + 0.01]).collect();
        let outline: Vec<Place> = upper.into_iter().chain(walk.rev().map(|z| [z, 9.0])).collect();
        if self.roof != self.paint {
            canvas.fill(&outline, self.roof);
        }
        if profile.in_box(profile.rear) {
            let wall = profile.roof_end - 0.03;
            canvas.fill(&rectangle([wall, 0.0], [profile.rear + 1.0, 9.0]), self.cargo);
            // Where the panels of the box are joined.
            for z in steps(wall, profile.rear, 3) {
                canvas.trace(&[[z, 0.0], [z, 9.0]], 0.03, darker(self.cargo, 0.7));
            }
        }
    }

    fn paint_decals(&self, canvas: &mut Canvas, profile: &Profile, doors: &Doors) {
        let length = profile.rear - profile.front;
        let [floor, belt] = [profile.parameters.size.clearance, profile.belt(0.0)];
        // Lettering fills the sides of vans and trucks.
        let windowless = profile.in_box(profile.rear)
            || self.detail.panel_van && profile.parameters.style == BodyStyle::Van;
        let top = if windowless { profile.top(0.0) } else { belt };
        for decal in &self.detail.decals {
            let center =
                [profile.front + decal.center[0] * length, floor + decal.center[1] * (top - floor)];
            let half_size = [decal.half_size[0] * length, decal.half_size[1] * (top - floor)];
            canvas.fill(&superellipse(center, half_size, decal.exponent), decal.color);
        }
        if self.detail.door_band {
            let y = floor + 0.62 * (belt - floor);
            canvas.trace(&[[doors.start - 0.3, y], [profile.rear - 0.3, y]], 0.05, self.decal);
        }
    }

    /// Sills, cladding, bumpers and the dark edges of the wheel arches.
    fn paint_lower_side(&self, canvas: &mut Canvas, profile: &Profile) {
        let floor = profile.parameters.size.clearance;
        let [left, right] = [profile.front - 1.0, profile.rear + 1.0];
        let sill = floor + if self.detail.cladding { 0.17 } else { 0.07 };
        canvas.fill(&rectangle([left, 0.0], [right, sill]), self.trim);
        if self.detail.plastic_bumpers {
            let top = 0.62 * profile.nose_height;
            for (z, inward) in [(profile.front, 1.0), (profile.rear, -1.0)] {
                let depth = if inward > 0.0 { 0.55 } else { 0.45 };
                canvas.fill(&rectangle([z - inward, 0.0], [z + inward * depth, top]), self.trim);
            }
        }
        let lip = if self.detail.cladding { 0.07 } else { 0.025 };
        let lip_color = if self.detail.cladding { self.trim } else { darker(self.paint, 0.5) };
        for axle in profile.axles {
            let radius = profile.arch_radius + lip;
            let arch = superellipse([axle, profile.parameters.axles.radius], [radius; 2], 2.0);
            canvas.fill(&arch, lip_color);
        }
    }

    /// Gaps around doors, bonnet and boot; handles, filler cap, and a crease.
    fn paint_gaps(&self, canvas: &mut Canvas, profile: &Profile, doors: &Doors) {
        let gap = darker(self.paint, 0.3);
        let floor = profile.parameters.size.clearance + 0.12;
        let crease: Vec<_> = steps(profile.front + 0.5, profile.rear - 0.25, 8)
            .map(|z| [z, 0.84 * profile.belt(z)])
            .collect();
        canvas.trace(&crease, 0.03, darker(self.paint, 0.8));
        let lower = darker(self.paint, 0.88);
        canvas.trace(&[[doors.start, floor + 0.13], [doors.ends[0], floor + 0.13]], 0.03, lower);

        let mut start = doors.start;
        for &end in &doors.ends {
            // A rear door gives way to the wheel arch.
            let arch = profile.axles[1] - profile.arch_radius - 0.06;
            let foot = end.min(arch);
            let knee = [end, profile.parameters.axles.radius + profile.arch_radius];
            let outline = [
                [start, floor],
                [foot, floor],
                if end > arch { knee } else { [foot, floor] },
                [end, profile.belt(end)],
                [start, profile.belt(start)],
            ];
            canvas.outline(&outline, GAP_WIDTH, gap);
            let handle = [end - 0.17, 0.88 * profile.belt(end)];
            canvas.fill(&superellipse([handle[0], handle[1] - 0.015], [0.11, 0.04], 4.0), gap);
            canvas.fill(&superellipse(handle, [0.10, 0.022], 5.0), self.accent);
            start = end;
        }
        let cap = [profile.axles[1] + 0.12, 0.82 * profile.belt(profile.axles[1])];
        canvas.outline(&superellipse(cap, [0.085; 2], 4.0), GAP_WIDTH, gap);
        let seam = profile.cowl - 0.05;
        canvas.trace(&[[seam, profile.belt(seam)], [seam + 0.1, floor]], GAP_WIDTH, gap);
    }

    /// The side windows as one band, divided by pillars.
    fn paint_windows(&self, canvas: &mut Canvas, profile: &Profile, doors: &Doors) {
        let Some(band) = self.window_band(profile, doors) else { return };
        let (frame_color, frame): (Color, f32) =
            if self.detail.bright_window_line { (self.accent, 0.05) } else { ([0.05; 3], 0.06) };
        canvas.outline(&band, frame, frame_color);
        canvas.fill(&band, self.glass);

        let pillar = |canvas: &mut Canvas, z: f32, width: f32, color: Color| {
            let (low, high) = (profile.belt(z) - 0.02, profile.top(z) - ROOF_FRAME);
            canvas.trace(&[[z, low], [z + 0.04, high]], width, color);
        };
        let glass_end = band.iter().map(|place| place[0]).fold(f32::NEG_INFINITY, f32::max);
        for &end in doors.ends.iter().filter(|&&end| end < glass_end - 0.15) {
            pillar(canvas, end, self.detail.pillar_width, [0.06; 3]);
        }
        let quarter_light = doors.start + 0.28;
        if profile.top(quarter_light) - profile.belt(quarter_light) > 0.25 {
            pillar(canvas, quarter_light, 0.03, [0.06; 3]);
        }
    }

    /// The outline of the side windows, if the car has any.
    fn window_band(&self, profile: &Profile, doors: &Doors) -> Option<Vec<Place>> {
        let start = profile.cowl;
        let end = match profile.parameters.style {
            BodyStyle::Van if self.detail.panel_van => doors.ends[0] - 0.02,
            BodyStyle::Pickup | BodyStyle::BoxTruck => profile.roof_end - 0.06,
            _ => {
                let rear_pillar = 0.5 * (profile.deck_start - profile.roof_end).min(0.7);
                (profile.roof_end + rear_pillar).min(profile.rear - 0.30)
            }
        };
        let head = |z: f32| profile.top(z) - ROOF_FRAME;
        let glazed = steps(start, end, 40).filter(|&z| head(z) > profile.belt(z) + 0.07);
        let glazed: Vec<f32> = glazed.collect();
        let sill = glazed.iter().map(|&z| [z, profile.belt(z) + 0.045]);
        let mut outline: Vec<Place> = sill.collect();
        outline.extend(glazed.iter().rev().map(|&z| [z, head(z)]));
        (outline.len() > 6).then_some(outline)
    }

    /// Where head and tail lamps reach around the corners.
    fn paint_lamps(&self, canvas: &mut Canvas, profile: &Profile) {
        let ends = &profile.parameters.ends;
        let (y, half_height) = self.headlamp(profile);
        let depth = ends.front_bow + 0.16;
        let lamp = [
            [profile.front - 0.2, y - half_height],
            [profile.front + 0.7 * depth, y - half_height],
            [profile.front + depth, y + half_height],
            [profile.front - 0.2, y + half_height],
        ];
        canvas.fill(&lamp, self.lamp);
        canvas.outline(&lamp, 0.015, [0.1; 3]);

        let [low, high] = self.tail_lamp_heights(profile);
        let inner = profile.rear - ends.rear_bow - 0.13;
        canvas.fill(&rectangle([inner, low], [profile.rear + 0.2, high]), self.tail_lamp);
        let marker = [profile.axles[0] + profile.arch_radius + 0.07, 0.72 * profile.bonnet_height];
        canvas.fill(&superellipse(marker, [0.04, 0.018], 4.0), [0.9, 0.5, 0.1]);
    }
}
