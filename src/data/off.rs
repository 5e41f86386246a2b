//! OFF files: Geomview's vertices and polygons, and their colours.

use std::{fs, iter::Enumerate, path::Path, str::Lines};

use nalgebra::Point3;

use super::{
    mesh::{GREY, Mesh, Triangle, checked_vertex, mean_color},
    mesh_file::Loaded,
    polygon::triangles,
};
use crate::{Error, Result};

/// Reads OFF, COFF, NOFF and CNOFF as text. Faces of one or two corners are points and lines, and
/// left out.
pub fn read_off(path: &Path) -> Result<Loaded> {
    let refuse = |reason| Error::Mesh { path: path.into(), reason };
    let bytes = fs::read(path).map_err(Error::io(path))?;
    let text = String::from_utf8_lossy(&bytes);
    let mut reader = Reader { lines: text.lines().enumerate(), line: 0 };
    let mesh =
        reader.read_mesh().map_err(|reason| refuse(format!("line {}: {reason}", reader.line)))?;
    mesh.validate().map_err(refuse)?;
    Ok(Loaded { mesh, warnings: Vec::new() })
}

struct Reader<'a> {
    lines: Enumerate<Lines<'a>>,
    /// The line that was read last, counted from 1.
    line: usize,
}

/// What stands at the start of a file.
struct Header {
    n_vertices: usize,
    n_faces: usize,
    /// Words before a vertex's colour; none if vertices have no colours.
    color_at: Option<usize>,
}

impl<'a> Reader<'a> {
    fn read_mesh(&mut self) -> Result<Mesh, String> {
        let header = self.read_header()?;
        let mut mesh = Mesh::default();
        let mut colors = Vec::new();
        for _ in 0..header.n_vertices {
            let words = self.next_words()?;
            mesh.vertices.push(vertex(&words)?);
            let color = header.color_at.and_then(|first| color(words.get(first..)?));
            colors.push(color.unwrap_or(GREY));
        }
        for _ in 0..header.n_faces {
            let words = self.next_words()?;
            let (corners, color) = face(&words, mesh.vertices.len())?;
            let position = |corner: u32| mesh.vertices[corner as usize];
            mesh.triangles.extend(triangles(&corners, position).map(|corners| {
                let blend = || mean_color(corners.map(|corner| colors[corner as usize]));
                Triangle::plain(corners, color.unwrap_or_else(blend))
            }));
        }
        Ok(mesh)
    }

    fn read_header(&mut self) -> Result<Header, String> {
        let mut words = self.next_words()?;
        // ModelNet has files in which the first count sticks to the keyword.
        let Some((kind, stuck)) = words[0].split_once("OFF") else {
            return Err("it does not start with OFF".into());
        };
        // Texture coordinates would come last, after all that is read here.
        let color_at = match kind.trim_start_matches("ST") {
            "" | "N" => None,
            "C" => Some(3),
            "CN" => Some(6),
            _ => return Err(format!("there is no reader for {}", words[0])),
        };
        if words.get(1) == Some(&"BINARY") {
            return Err("there is no reader for binary OFF".into());
        }
        words[0] = stuck;
        words.retain(|word| !word.is_empty());
        if words.is_empty() {
            words = self.next_words()?;
        }
        let count = |idx: usize| {
            let word: &str = words.get(idx).ok_or("expected counts of vertices and faces")?;
            word.parse().map_err(|_| format!("{word:?} is not a count"))
        };
        Ok(Header { n_vertices: count(0)?, n_faces: count(1)?, color_at })
    }

    /// The words of the next line that has any; comments do not count.
    fn next_words(&mut self) -> Result<Vec<&'a str>, String> {
        for (idx, line) in self.lines.by_ref() {
            self.line = idx + 1;
            let code = line.split('#').next().unwrap_or("");
            let words: Vec<_> = code.split_whitespace().collect();
            if !words.is_empty() {
                return Ok(words);
            }
        }
        Err("the file ends here, and not all of it was read".into())
    }
}

fn vertex(words: &[&str]) -> Result<Point3<f32>, String> {
    let mut coordinates = [0.0; 3];
    for (axis, coordinate) in coordinates.iter_mut().enumerate() {
        let word = words.get(axis).ok_or("a vertex needs three coordinates")?;
        *coordinate = word.parse().map_err(|_| format!("{word:?} is not a number"))?;
    }
    checked_vertex(coordinates)
}

/// The corners of a face, and its colour if it has one.
fn face(words: &[&str], n_vertices: usize) -> Result<(Vec<u32>, Option<[f32; 3]>), String> {
    let n_corners: usize =
        words[0].parse().map_err(|_| format!("{:?} is not a count", words[0]))?;
    let (indices, rest) = words[1..]
        .split_at_checked(n_corners)
        .ok_or_else(|| format!("{n_corners} corners are promised, {} follow", words.len() - 1))?;
    let corners = indices.iter().map(|word| {
        let index: u32 = word.parse().map_err(|_| format!("{word:?} is not an index"))?;
        let exists = (index as usize) < n_vertices;
        exists.then_some(index).ok_or_else(|| format!("index {index} is not below {n_vertices}"))
    });
    Ok((corners.collect::<Result<_, String>>()?, color(rest)))
}

/// Three whole numbers of at most 255, or three shares; a single number is an index into a map of
/// colours that no file brings along.
fn color(words: &[&str]) -> Option<[f32; 3]> {
    let words: [&str; 3] = words.get(..3)?.try_into().ok()?;
    let whole = words.iter().all(|word| word.parse::<u32>().is_ok());
    let mut color = [0.0; 3];
    for (channel, word) in color.iter_mut().zip(words) {
        let value: f32 = word.parse().ok().filter(|value: &f32| value.is_finite())?;
        *channel = (if whole { value / 255.0 } else { value }).clamp(0.0, 1.0);
    }
    Some(color)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

    fn read(text: &str) -> Result<Loaded> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("model.off");
        fs::write(&path, text).expect("writable");
        read_off(&path)
    }

    fn loaded(text: &str) -> Mesh {
        read(text).expect("it is a mesh").mesh
    }

    #[track_caller]
    fn check_refused(text: &str, reason: &str) {
        let error = read(text).expect_err("it is broken").to_string();
        assert!(error.contains("model.off") && error.contains(reason), "{error}");
    }

    #[test]
    fn polygons_are_read_around_comments_and_windows_line_ends() {
        let text = format!("# made by hand\nOFF # a square\n\n4 1 0\n{CORNERS}4 0 1 2 3 # face\n");
        for text in [text.clone(), text.replace('\n', "\r\n")] {
            let triangles: Vec<_> = loaded(&text).triangles.iter().map(|t| t.vertices).collect();
            assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
        }
    }

    #[test]
    fn counts_may_stand_beside_the_keyword() {
        for start in ["OFF 4 1 0", "OFF4 1 0", "OFF\n4 1"] {
            assert_eq!(loaded(&format!("{start}\n{CORNERS}3 0 1 2\n")).triangles.len(), 1);
        }
    }

    #[test]
    fn colours_are_bytes_or_shares() {
        let faces = "3 0 1 2 255 0 51\n3 0 2 3 0.5 0 1.0 1\n3 0 1 3 7\n3 0 1 3\n";
        let mesh = loaded(&format!("OFF\n4 4 0\n{CORNERS}{faces}"));
        let colors: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.color).collect();
        assert_eq!(colors, [[1., 0., 0.2], [0.5, 0., 1.], GREY, GREY]);
    }

    #[test]
    fn a_triangle_takes_the_mean_of_its_vertices_colours() {
        let with = |color: &str| format!("0 0 0 {color}\n1 0 0 {color}\n0 1 0 0 0 0 255\n");
        let plain = loaded(&format!("COFF\n3 1 0\n{}3 0 1 2\n", with("255 153 0 255")));
        assert_eq!(plain.triangles[0].color, [2.0 / 3.0, 0.4, 0.0]);
        let normals =
            "0 0 0 0 0 1 51 51 51 255\n1 0 0 0 0 1 51 51 51 255\n0 1 0 0 0 1 51 51 51 255\n";
        let mesh = loaded(&format!("CNOFF\n3 1 0\n{normals}3 0 1 2\n"));
        assert!(mesh.triangles[0].color.iter().all(|channel| (channel - 0.2).abs() < 1e-6));
    }

    #[test]
    fn points_and_lines_are_left_out() {
        let faces = "1 0\n2 0 1\n3 0 1 2\n";
        assert_eq!(loaded(&format!("OFF\n4 3 0\n{CORNERS}{faces}")).triangles.len(), 1);
    }

    #[test]
    fn broken_files_are_refused_with_their_line() {
        check_refused("", "line 0");
        check_refused("ply\n", "line 1: it does not start with OFF");
        check_refused("4OFF\n", "no reader for 4OFF");
        check_refused("OFF BINARY\n", "no reader for binary");
        check_refused("OFF\n4\n", "line 2: expected counts");
        check_refused("OFF\n-4 1 0\n", "line 2: \"-4\"");
        check_refused("OFF\n1 0 0\n0 0\n", "line 3: a vertex needs three");
        check_refused("OFF\n1 0 0\n0 0 x\n", "line 3: \"x\"");
        check_refused("OFF\n1 0 0\n0 nan 0\n", "line 3: coordinate NaN");
        check_refused(&format!("OFF\n9 1 0\n{CORNERS}"), "line 6: the file ends");
        check_refused(&format!("OFF\n99999999999999 1 0\n{CORNERS}"), "the file ends");
        check_refused(&format!("OFF\n4 1 0\n{CORNERS}3 0 1 4\n"), "line 7: index 4");
        check_refused(&format!("OFF\n4 1 0\n{CORNERS}3 0 1 -1\n"), "line 7: \"-1\"");
        check_refused(&format!("OFF\n4 1 0\n{CORNERS}4 0 1 2\n"), "line 7: 4 corners");
        check_refused(&format!("OFF\n4 0 0\n{CORNERS}"), "no triangles");
        check_refused(&format!("OFF\n4 1 0\n{CORNERS}3 1 1 1\n"), "no area");
    }
}
