//! Textured triangle meshes.

use nalgebra::{Point3, Vector3, distance};

/// What has no colour of its own.
pub const GREY: [f32; 3] = [0.7; 3];
/// Largest coordinate that is taken for geometry, in the file's units.
const LARGEST_COORDINATE: f32 = 1e6;

/// A triangle mesh in the canonical world frame, unless a reader says otherwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<Point3<f32>>,
    pub triangles: Vec<Triangle>,
    pub textures: Vec<image::RgbImage>,
}

/// A triangle and its material: `color`, times `textures[texture]` at the interpolated `uvs`.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub vertices: [u32; 3],
    /// Texture coordinates, v upwards as in OBJ; they repeat beyond [0, 1].
    pub uvs: [[f32; 2]; 3],
    /// Diffuse albedo, RGB in [0, 1].
    pub color: [f32; 3],
    pub texture: Option<u32>,
}

impl Triangle {
    /// One colour, and no texture.
    pub fn plain(vertices: [u32; 3], color: [f32; 3]) -> Self {
        Self { vertices, uvs: [[0.0; 2]; 3], color, texture: None }
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: Point3<f32>,
    pub max: Point3<f32>,
}

impl Bounds {
    pub fn center(&self) -> Point3<f32> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Length of the box's diagonal.
    pub fn diagonal(&self) -> f32 {
        distance(&self.min, &self.max)
    }
}

impl Mesh {
    /// The corners of one triangle.
    pub fn corners(&self, triangle: &Triangle) -> [Point3<f32>; 3] {
        triangle.vertices.map(|vertex| self.vertices[vertex as usize])
    }

    /// Twice the area of a triangle, along its normal by the right-hand rule.
    pub fn area_vector(&self, triangle: &Triangle) -> Vector3<f32> {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(&(c - a))
    }

    /// The box around the triangles, or `None` without any. Loose vertices do not count.
    pub fn bounds(&self) -> Option<Bounds> {
        let mut corners = self.triangles.iter().flat_map(|triangle| self.corners(triangle));
        let first = corners.next()?;
        Some(corners.fold(Bounds { min: first, max: first }, |bounds, corner| Bounds {
            min: bounds.min.inf(&corner),
            max: bounds.max.sup(&corner),
        }))
    }

    /// Moves the box's centre to the origin and scales its diagonal to 1: the canonical frame.
    ///
    /// A mesh without extent is left as it is; [`Mesh::validate`] refuses those.
    pub fn normalise(&mut self) {
        let Some(bounds) = self.bounds().filter(|bounds| bounds.diagonal() > 0.0) else { return };
        let (center, diagonal) = (bounds.center(), bounds.diagonal());
        for vertex in &mut self.vertices {
            *vertex = Point3::from((*vertex - center) / diagonal);
        }
    }

    /// [`Mesh::normalise`], by value.
    pub fn normalised(mut self) -> Self {
        self.normalise();
        self
    }

    /// Adds the triangles, vertices and textures of `other`.
    pub fn merge(&mut self, other: Self) {
        let (vertex_offset, texture_offset) = (self.vertices.len(), self.textures.len());
        self.vertices.extend(other.vertices);
        self.textures.extend(other.textures);
        self.triangles.extend(other.triangles.into_iter().map(|triangle| Triangle {
            vertices: triangle.vertices.map(|vertex| vertex + vertex_offset as u32),
            texture: triangle.texture.map(|texture| texture + texture_offset as u32),
            ..triangle
        }));
    }

    /// Says why nothing can be sampled or drawn from this mesh, if so.
    pub fn validate(&self) -> Result<(), String> {
        if self.triangles.is_empty() {
            return Err("it has no triangles".into());
        }
        for (idx, &vertex) in self.vertices.iter().enumerate() {
            checked_vertex(vertex.into())
                .map_err(|reason| format!("vertex {}: {reason}", idx + 1))?;
        }
        for (idx, triangle) in self.triangles.iter().enumerate() {
            if triangle.vertices.iter().any(|&vertex| vertex as usize >= self.vertices.len()) {
                return Err(format!("triangle {} names a vertex that does not exist", idx + 1));
            }
            if triangle.texture.is_some_and(|texture| texture as usize >= self.textures.len()) {
                return Err(format!("triangle {} names a texture that does not exist", idx + 1));
            }
            if !triangle.uvs.iter().flatten().all(|&coordinate| is_usable(coordinate)) {
                return Err(format!("triangle {} has unusable texture coordinates", idx + 1));
            }
        }
        // Compared at unit size, where a collapsed mesh and a small one differ.
        let diagonal = self.bounds().map_or(0.0, |bounds| bounds.diagonal());
        let area: f32 = self.triangles.iter().map(|t| self.area_vector(t).norm()).sum();
        if diagonal <= 0.0 || area / diagonal / diagonal <= 1e-9 {
            return Err("its triangles have no area".into());
        }
        Ok(())
    }
}

/// A vertex, unless its coordinates are no geometry.
pub fn checked_vertex(coordinates: [f32; 3]) -> Result<Point3<f32>, String> {
    match coordinates.iter().find(|coordinate| !is_usable(**coordinate)) {
        None => Ok(Point3::from(coordinates)),
        Some(coordinate) => Err(format!("coordinate {coordinate} is not finite, or huge")),
    }
}

/// The one colour of a triangle whose corners have three.
pub fn mean_color(corners: [[f32; 3]; 3]) -> [f32; 3] {
    std::array::from_fn(|c| corners.iter().map(|color| color[c]).sum::<f32>() / 3.0)
}

fn is_usable(coordinate: f32) -> bool {
    coordinate.abs() <= LARGEST_COORDINATE // false for NaN
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle_mesh(corners: [[f32; 3]; 3]) -> Mesh {
        Mesh {
            vertices: corners.map(Point3::from).to_vec(),
            triangles: vec![Triangle::plain([0, 1, 2], GREY)],
            textures: vec![],
        }
    }

    #[track_caller]
    fn check_refused(mesh: &Mesh, reason: &str) {
        let refusal = mesh.validate().expect_err("the mesh is unusable");
        assert!(refusal.contains(reason), "{refusal}");
    }

    #[test]
    fn a_normalised_mesh_is_centred_with_unit_diagonal() {
        let mesh = triangle_mesh([[1., 2., 3.], [5., 2., 3.], [1., 5., 15.]]).normalised();
        let bounds = mesh.bounds().expect("it has a triangle");
        assert!(bounds.center().coords.norm() < 1e-6);
        assert!((bounds.diagonal() - 1.0).abs() < 1e-6);
        assert!((bounds.max - bounds.min - Vector3::new(4., 3., 12.) / 13.0).norm() < 1e-6);
    }

    #[test]
    fn loose_vertices_do_not_widen_the_box() {
        let mut mesh = triangle_mesh([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        mesh.vertices.push(Point3::new(9., 9., 9.));
        assert_eq!(mesh.bounds().expect("it has a triangle").max, Point3::new(1., 1., 0.));
    }

    #[test]
    fn merging_keeps_each_triangle_on_its_own_vertices() {
        let mut mesh = triangle_mesh([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        let other = triangle_mesh([[0., 0., 7.], [1., 0., 7.], [0., 1., 7.]]);
        mesh.merge(other.clone());
        assert_eq!(mesh.corners(&mesh.triangles[1]), other.corners(&other.triangles[0]));
    }

    #[test]
    fn unusable_geometry_is_refused() {
        check_refused(&Mesh::default(), "no triangles");
        check_refused(&triangle_mesh([[f32::NAN, 0., 0.], [1., 0., 0.], [0., 1., 0.]]), "vertex 1");
        check_refused(&triangle_mesh([[0., 0., 0.], [1e30, 0., 0.], [0., 1., 0.]]), "vertex 2");
        check_refused(&triangle_mesh([[0., 0., 0.], [1., 1., 1.], [2., 2., 2.]]), "no area");
        check_refused(&triangle_mesh([[1., 1., 1.]; 3]), "no area");
        let mut dangling = triangle_mesh([[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        dangling.triangles[0].vertices[2] = 3;
        check_refused(&dangling, "does not exist");
    }

    #[test]
    fn a_tiny_mesh_is_usable() {
        let mesh = triangle_mesh([[0., 0., 0.], [1e-6, 0., 0.], [0., 1e-6, 0.]]);
        assert_eq!(mesh.validate(), Ok(()));
    }
}
