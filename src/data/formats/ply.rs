//! Point clouds as PLY, which every mesh viewer opens.

use std::{
    fs::File,
    io::{BufReader, Cursor},
    path::Path,
};

use nalgebra::Point3;
use ply_rs_bw::{
    parser::Parser,
    ply::{
        ElementDef, Encoding, Ply, PropertyAccess, PropertyAccessResult, PropertyDef, PropertyType,
        ScalarType,
    },
    writer::Writer,
};

use super::write_atomically;
use crate::{Error, Result};

/// What to write of a cloud. Where present, `colors` and `visible` hold one entry a point; points
/// beyond their end are written black and hidden.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    pub points: Vec<Point3<f32>>,
    pub colors: Option<Vec<[u8; 3]>>,
    /// Whether the reference frame sees the point.
    pub visible: Option<Vec<bool>>,
}

impl PointCloud {
    /// RGB of a point; black where it has none.
    pub fn color(&self, point_idx: usize) -> [u8; 3] {
        let colors = self.colors.as_ref();
        colors.and_then(|colors| colors.get(point_idx).copied()).unwrap_or_default()
    }

    /// Whether the reference frame sees a point; not where nothing is said.
    pub fn is_visible(&self, point_idx: usize) -> bool {
        let visible = self.visible.as_ref();
        visible.and_then(|visible| visible.get(point_idx).copied()).unwrap_or_default()
    }
}

/// Reads the vertices of a PLY file, ASCII or binary; all else is left out.
pub fn read_points(path: &Path) -> Result<Vec<Point3<f32>>> {
    Ok(read_cloud(path)?.points)
}

/// Reads the vertices of a PLY file, ASCII or binary, with their `red`, `green`, `blue` and `visible`
/// if they are bytes; other elements and properties are left out.
pub fn read_cloud(path: &Path) -> Result<PointCloud> {
    let unusable = |reason: String| Error::Points { path: path.into(), reason };
    let mut reader = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let mut ply = Parser::<Vertex>::new()
        .read_ply(&mut reader)
        .map_err(|error| unusable(error.to_string()))?;
    let vertices = ply.payload.shift_remove("vertex").unwrap_or_default();
    if vertices.is_empty() {
        return Err(unusable("it has no vertices".into()));
    }
    let infinite = |vertex: &Vertex| vertex.position.iter().any(|value| !value.is_finite());
    if let Some(idx) = vertices.iter().position(infinite) {
        return Err(unusable(format!("vertex {idx} has no finite x, y and z")));
    }
    let byte = PropertyType::Scalar(ScalarType::UChar);
    let has_bytes = |name: &str| {
        let element = ply.header.elements.get("vertex");
        let property = element.and_then(|element| element.properties.get(name));
        property.is_some_and(|property| property.data_type == byte)
    };
    let colored = ["red", "green", "blue"].into_iter().all(has_bytes);
    Ok(PointCloud {
        points: vertices.iter().map(|vertex| vertex.position).collect(),
        colors: colored.then(|| vertices.iter().map(|vertex| vertex.color).collect()),
        visible: has_bytes("visible")
            .then(|| vertices.iter().map(|vertex| vertex.visible).collect()),
    })
}

/// Writes binary PLY: x, y, z, then red, green, blue and visible (0 or 1) where known.
pub fn write_points(path: &Path, cloud: &PointCloud) -> Result<()> {
    let mut element = ElementDef::new("vertex".into());
    let mut declare = |names: &[&str], scalar: ScalarType| {
        for name in names {
            let property = PropertyDef::new((*name).into(), PropertyType::Scalar(scalar.clone()));
            element.properties.insert((*name).into(), property);
        }
    };
    declare(&["x", "y", "z"], ScalarType::Float);
    if cloud.colors.is_some() {
        declare(&["red", "green", "blue"], ScalarType::UChar);
    }
    if cloud.visible.is_some() {
        declare(&["visible"], ScalarType::UChar);
    }

    let vertices = cloud.points.iter().enumerate().map(|(idx, point)| Vertex {
        position: *point,
        color: cloud.color(idx),
        visible: cloud.is_visible(idx),
    });
    let mut ply = Ply::<Vertex>::new();
    ply.header.encoding = Encoding::BinaryLittleEndian;
    ply.header.elements.insert("vertex".into(), element);
    ply.payload.insert("vertex".into(), vertices.collect());

    let mut bytes = Cursor::new(vec![]);
    Writer::new().write_ply(&mut bytes, &mut ply).map_err(Error::io(path))?;
    write_atomically(path, bytes.get_ref())
}

/// One vertex of a file; coordinates that the file leaves out stay NaN.
struct Vertex {
    position: Point3<f32>,
    color: [u8; 3],
    visible: bool,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.position[axis] = value;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: Point3::from([f32::NAN; 3]), color: [0; 3], visible: false }
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value as f32)
    }

    fn set_uchar(&mut self, name: &str, value: u8) -> PropertyAccessResult {
        match name {
            "red" => self.color[0] = value,
            "green" => self.color[1] = value,
            "blue" => self.color[2] = value,
            "visible" => self.visible = value != 0,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        ["x", "y", "z"].iter().position(|axis| *axis == name).map(|axis| self.position[axis])
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        match name {
            "red" => Some(self.color[0]),
            "green" => Some(self.color[1]),
            "blue" => Some(self.color[2]),
            "visible" => Some(self.visible.into()),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
