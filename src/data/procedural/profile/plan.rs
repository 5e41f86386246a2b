//! The lines from above: width, and how both ends are bowed and rounded.

use super::{Profile, ramp};

impl Profile {
    /// Half the body's width at `z`, at the widest.
    pub fn half_width(&self, z: f32) -> f32 {
        self.half_width_in_plan(z) - self.edge_inset(z)
    }

    /// How far backwards the bow of the ends moves what stands at `[x, z]`.
    pub fn bow(&self, x: f32, z: f32) -> f32 {
        let ends = &self.parameters.ends;
        // The bow fades out before the wheel arch, and too slowly for sections to cross.
        let fade = |depth: f32, overhang: f32, bow: f32| {
            let overhang = overhang.max(0.01);
            bow.min(0.4 * overhang) * ramp(1.0 - depth / overhang).powi(2)
        };
        let front_overhang = self.axles[0] - self.arch_radius - self.front;
        let rear_overhang = self.rear - self.axles[1] - self.arch_radius;
        let front = fade(z - self.front, front_overhang, ends.front_bow);
        let rear = fade(self.rear - z, rear_overhang, ends.rear_bow);
        (x / self.half_width_in_plan(z)).powi(2) * (front - rear)
    }

    /// A quarter round on the edges of both ends.
    pub(super) fn edge_inset(&self, z: f32) -> f32 {
        let radius = self.parameters.ends.edge_radius;
        let remaining = radius - (z - self.front).min(self.rear - z).clamp(0.0, radius);
        radius - (radius * radius - remaining * remaining).max(0.0).sqrt()
    }

    /// Half the body's width before the ends are rounded.
    fn half_width_in_plan(&self, z: f32) -> f32 {
        let t = self.fraction(z);
        let ends = &self.parameters.ends;
        let taper = ends.front_taper * ramp((0.25 - t) / 0.25).powf(2.2)
            + ends.rear_taper * ramp((t - 0.75) / 0.25).powf(2.2);
        let width_fraction = if self.in_box(z) { 1.0 } else { self.parameters.cabin.width };
        let half_width = self.parameters.size.width / 2.0 * width_fraction;
        half_width * (1.0 - taper)
    }
}
