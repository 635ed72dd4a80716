//! glTF 2.0 in one file (GLB): positions, normals, indices, and a picture with its coordinates.
//!
//! glTF counts metres, x to the right, y up and z towards the viewer: here x is east, y up and z south. Positions are less an origin of whole units, which the node adds again; where coordinates are in
//! another unit than metres, its scale brings them to metres. Order of the file: JSON, then one buffer of positions, normals, texture coordinates, indices and the picture.

use super::{Format, MeshFile};
use serde_json::{Value, json};
use std::io::{self, Write};
use terrasoar_layout::printable;

const FLOAT: u32 = 5126;
const UINT: u32 = 5125;
const ARRAY: u32 = 34962;
const ELEMENTS: u32 = 34963;
/// Bytes of the header and of the heads of both chunks.
const HEADS: u64 = 12 + 2 * 8;
/// Ground without a picture.
const GREY: [f64; 4] = [0.62, 0.61, 0.58, 1.0];

/// Who made it, as the file says it.
pub(super) fn generator(note: &str) -> String {
    format!("Terrasoar {}: {note}", env!("CARGO_PKG_VERSION"))
}

/// Parts of the buffer, one behind the other.
#[derive(Default)]
struct Views {
    json: Vec<Value>,
    end: u64,
}

impl Views {
    /// A part of so many bytes, a multiple of 4 but for the last; its number.
    fn add(&mut self, bytes: u64, target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.end, "byteLength": bytes });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.json.push(view);
        self.end += bytes;
        self.json.len() - 1
    }
}

pub(super) fn write(file: &MeshFile<'_>, out: &mut dyn Write) -> io::Result<()> {
    let origin = file.origin(Format::Glb);
    let (vertices, triangles) = (file.mesh.positions.len() as u64, file.mesh.triangles.len() as u64);
    let mut views = Views::default();
    let positions = views.add(12 * vertices, Some(ARRAY));
    let normals = views.add(12 * vertices, Some(ARRAY));
    let texels = file.texture.map(|_| views.add(8 * vertices, Some(ARRAY)));
    let indices = views.add(12 * triangles, Some(ELEMENTS));
    let picture = file.texture.map(|texture| views.add(texture.png.len() as u64, None));
    let buffer_bytes = views.end.next_multiple_of(4);

    let [low, high] = bounds(file, origin);
    let mut accessors = vec![
        json!({ "bufferView": positions, "componentType": FLOAT, "count": vertices, "type": "VEC3", "min": low, "max": high }),
        json!({ "bufferView": normals, "componentType": FLOAT, "count": vertices, "type": "VEC3" }),
        json!({ "bufferView": indices, "componentType": UINT, "count": 3 * triangles, "type": "SCALAR" }),
    ];
    let mut attributes = json!({ "POSITION": 0, "NORMAL": 1 });
    if let Some(texels) = texels {
        accessors
            .push(json!({ "bufferView": texels, "componentType": FLOAT, "count": vertices, "type": "VEC2" }));
        attributes["TEXCOORD_0"] = 3.into();
    }
    let mut notes: serde_json::Map<String, Value> = file
        .notes
        .iter()
        .map(|(name, value)| ((*name).to_owned(), printable::line(value).into_owned().into()))
        .collect();
    notes.insert("Origin".into(), json!(origin));
    let metres = 1.0 / file.placing.height_factor;
    let mut node = json!({ "mesh": 0, "name": "terrain" });
    if origin != [0.0; 2] {
        node["translation"] = json!([origin[0] * metres, 0.0, -origin[1] * metres]);
    }
    if metres != 1.0 {
        node["scale"] = json!([metres, metres, metres]);
    }
    let mut material = json!({ "name": "ground", "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } });
    let surface = &mut material["pbrMetallicRoughness"];
    match file.texture {
        Some(_) => surface["baseColorTexture"] = json!({ "index": 0 }),
        None => surface["baseColorFactor"] = json!(GREY),
    }
    let mut scene = json!({
        "asset": { "version": "2.0", "generator": generator(file.note()), "extras": notes },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [node],
        "materials": [material],
        "accessors": accessors,
        "bufferViews": views.json,
        "buffers": [{ "byteLength": buffer_bytes }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": 2, "material": 0 }] }],
    });
    if let Some(picture) = picture {
        scene["images"] = json!([{ "bufferView": picture, "mimeType": "image/png" }]);
        // Smooth, and not repeated beyond its rim.
        scene["samplers"] = json!([{ "magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071 }]);
        scene["textures"] = json!([{ "sampler": 0, "source": 0 }]);
    }
    if triangles == 0 {
        // An accessor of nothing is none.
        for part in
            ["meshes", "accessors", "bufferViews", "buffers", "images", "samplers", "textures", "materials"]
        {
            scene.as_object_mut().map(|scene| scene.remove(part));
        }
        scene["nodes"] = json!([{ "name": "terrain" }]);
    }
    let mut text = serde_json::to_vec(&scene)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let (buffer_bytes, heads) = if triangles == 0 { (0, HEADS - 8) } else { (buffer_bytes, HEADS) };
    let length = u32::try_from(heads + text.len() as u64 + buffer_bytes).map_err(|_| {
        io::Error::other("GLB holds 4 GiB; allow a larger error, take a smaller window, or write PLY")
    })?;
    out.write_all(b"glTF")?;
    for number in [2, length, text.len() as u32] {
        out.write_all(&number.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if triangles > 0 {
        out.write_all(&(buffer_bytes as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        write_buffer(file, origin, out)?;
        out.write_all(&vec![0; (buffer_bytes - views.end) as usize])?;
    }
    Ok(())
}

/// A position as the file has it.
fn position(origin: [f64; 2], [x, y, z]: [f64; 3]) -> [f32; 3] {
    [(x - origin[0]) as f32, z as f32, (origin[1] - y) as f32]
}

/// Least and greatest of each axis, of the numbers as they are written.
fn bounds(file: &MeshFile<'_>, origin: [f64; 2]) -> [[f32; 3]; 2] {
    file.positions().map(|point| position(origin, point)).fold(
        [[f32::MAX; 3], [f32::MIN; 3]],
        |[low, high], at| {
            [std::array::from_fn(|i| low[i].min(at[i])), std::array::from_fn(|i| high[i].max(at[i]))]
        },
    )
}

fn write_buffer(file: &MeshFile<'_>, origin: [f64; 2], out: &mut dyn Write) -> io::Result<()> {
    for point in file.positions() {
        out.write_all(position(origin, point).map(f32::to_le_bytes).as_flattened())?;
    }
    for normal in normals(file) {
        out.write_all(normal.map(f32::to_le_bytes).as_flattened())?;
    }
    if let Some(texture) = file.texture {
        for [east, north, _] in &file.mesh.positions {
            out.write_all(texture.at([*east, *north]).map(f32::to_le_bytes).as_flattened())?;
        }
    }
    for triangle in file.triangles() {
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    if let Some(texture) = file.texture {
        out.write_all(&texture.png)?;
    }
    Ok(())
}

/// Of each vertex the mean of its triangles' normals by their areas, of length 1.
fn normals(file: &MeshFile<'_>) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f32; 3]; file.mesh.positions.len()];
    let place = |i: u32| file.placing.place(file.mesh.positions[i as usize]);
    for triangle in file.triangles() {
        let [a, b, c] = triangle.map(place);
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        // East, up, south.
        let normal = [u[1] * v[2] - u[2] * v[1], u[0] * v[1] - u[1] * v[0], u[0] * v[2] - u[2] * v[0]];
        for corner in triangle {
            (0..3).for_each(|i| sums[corner as usize][i] += normal[i] as f32);
        }
    }
    for sum in &mut sums {
        let length = sum.iter().map(|n| n * n).sum::<f32>().sqrt();
        *sum = if length > 0.0 && length.is_finite() { sum.map(|n| n / length) } else { [0.0, 1.0, 0.0] };
    }
    sums
}
