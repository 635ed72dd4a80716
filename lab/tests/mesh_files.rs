//! Meshes as others read them: GLB by the crate gltf, which checks it; the rest by their definitions.

use terrasoar::mesh::IndexedMesh;
use terrasoar::simplify::{SimplifyOptions, simplify};
use terrasoar_lab::mesh_file::{Format, MeshFile, Placing, Texture, is_ours};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::imagery::{DrapeOptions, Extent, MemoryImage, TileFormat, drape};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

fn small() -> IndexedMesh {
    IndexedMesh {
        positions: vec![[0.0, 0.0, 1.5], [10.0, 0.0, 2.0], [0.0, 10.0, 3.25]],
        triangles: vec![[0, 1, 2]],
    }
}

fn notes() -> [(&'static str, String); 2] {
    [("Reference system", "a\nb".to_owned()), ("Coordinates", "x = 1 + 2 * east".to_owned())]
}

fn written(file: &MeshFile<'_>, format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    file.write(format, &mut bytes).unwrap();
    assert!(is_ours(&bytes), "{format:?}");
    assert!(!is_ours(&bytes[1..]), "{format:?}");
    bytes
}

#[test]
fn text_formats_read_as_specified() {
    let (mesh, notes) = (small(), notes());
    let file = MeshFile::new(&mesh).notes(&notes);
    let obj = String::from_utf8(written(&file, Format::Obj)).unwrap();
    assert!(
        obj.contains("\n# Reference system: a\\nb\n# Coordinates: x = 1 + 2 * east\nv 0 0 1.5\n"),
        "{obj}"
    );
    assert!(obj.ends_with("v 0 0 1.5\nv 10 0 2\nv 0 10 3.25\nf 1 2 3\n"));
    let ply = String::from_utf8(written(&file, Format::PlyText)).unwrap();
    assert!(ply.contains("\ncomment Reference system: a\\nb\ncomment Coordinates: "), "{ply}");
    assert!(ply.starts_with("ply\nformat ascii 1.0\n"));
    assert!(ply.ends_with("end_header\n0 0 1.5\n10 0 2\n0 10 3.25\n3 0 1 2\n"));
}

#[test]
fn binary_ply_has_24_bytes_a_vertex_and_13_a_face() {
    let mesh = small();
    let ply = written(&MeshFile::new(&mesh), Format::PlyBinary);
    let end = b"end_header\n";
    let at = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    assert_eq!(ply.len() - at, 3 * 24 + 13);
    assert_eq!(ply[at + 16..at + 24], 1.5f64.to_le_bytes());
    assert_eq!(ply[at + 72..at + 77], [3, 0, 0, 0, 0]);
}

/// Coordinates that count to the west mirror the ground; triangles still turn to face up.
#[test]
fn mirrored_coordinates_turn_triangles_over() {
    let mesh = small();
    let mirrored = Placing { map: [500.0, -1.0, 0.0, 900.0, 0.0, 1.0], height_factor: 2.0 };
    let obj = String::from_utf8(written(&MeshFile::new(&mesh).placing(mirrored), Format::Obj)).unwrap();
    assert!(obj.ends_with("v 500 900 3\nv 490 900 4\nv 500 910 6.5\nf 1 3 2\n"), "{obj}");
}

fn singles(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

#[test]
fn stl_has_normals_and_says_what_coordinates_are_less_of() {
    let mesh = small();
    let local = written(&MeshFile::new(&mesh), Format::Stl);
    assert_eq!((local.len(), &local[80..84]), (84 + 50, &[1, 0, 0, 0][..]));
    assert!(!local.starts_with(b"solid"));
    let numbers = singles(&local[84..132]);
    assert_eq!(numbers[3..], [0.0, 0.0, 1.5, 10.0, 0.0, 2.0, 0.0, 10.0, 3.25]);
    let length: f32 = numbers[..3].iter().map(|n| n * n).sum();
    assert!((length - 1.0).abs() < 1e-6 && numbers[2] > 0.9);

    let placing = Placing { map: [2_600_000.25, 1.0, 0.0, 1_200_000.0, 0.0, 1.0], height_factor: 1.0 };
    let file = MeshFile::new(&mesh).placing(placing);
    assert_eq!(file.origin(Format::Stl), [2_600_000.0, 1_200_000.0]);
    assert_eq!(file.origin(Format::PlyBinary), [0.0; 2]);
    let far = written(&file, Format::Stl);
    assert!(String::from_utf8_lossy(&far[..80]).contains("less 2600000,1200000"));
    assert_eq!(singles(&far[84..132])[3..6], [0.25, 0.0, 1.5]);
}

/// A hilly terrain of 90 x 70 samples, 10 x 12 m apart, with a void and a picture over part of it.
fn draped(folder: &std::path::Path) -> Terrain {
    let dem = MemoryDem::from_fn([90, 70], SampleType::F32, |x, y| {
        if (40..45).contains(&x) && y < 6 { f64::NAN } else { f64::from(x * y % 37) + f64::from(x) * 0.25 }
    });
    let path = folder.join("t.iqt");
    build(&dem, &path, &BuildOptions::default().spacing_m([10.0, 12.0]), &Silent).unwrap();
    // From 100 m east to 900 m, from 0 to 600 m north: red grows to the east, green to the north.
    let image = MemoryImage::from_fn([1600, 1200], |x, y| [(x / 8) as u8, ((1199 - y) / 6) as u8, 50, 255]);
    let options = DrapeOptions::default()
        .format(TileFormat::Rgba8)
        .extent(Some(Extent::Metres([100.0, 0.0, 900.0, 600.0])));
    drape(&path, &[Box::new(image)], &options, &Silent).unwrap();
    Terrain::open(&path).unwrap()
}

/// The crate checks indices, targets and required properties; what the numbers should be is checked here.
fn read_glb(bytes: &[u8]) -> (gltf::Document, Vec<u8>) {
    assert_eq!(bytes.len() % 4, 0);
    assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
    let gltf = gltf::Gltf::from_slice(bytes).unwrap();
    (gltf.document, gltf.blob.unwrap_or_default())
}

#[test]
fn glb_is_read_by_others_with_the_picture_where_it_belongs() {
    let folder = tempfile::tempdir().unwrap();
    let terrain = draped(folder.path());
    let mesh = simplify(&terrain, &SimplifyOptions::default().max_error_m(2.0)).unwrap();
    let [east, north] = terrain.grid().extent_m();
    let texture = Texture::of(&terrain, [0.0, 0.0, east, north], 4096).unwrap().unwrap();
    let notes = notes();
    let file = MeshFile::new(&mesh).notes(&notes).texture(Some(&texture));
    let bytes = written(&file, Format::Glb);
    let (document, blob) = read_glb(&bytes);
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let wanted: Vec<[f32; 3]> =
        mesh.positions.iter().map(|[x, y, z]| [*x as f32, *z as f32, -*y as f32]).collect();
    assert!(positions == wanted);
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert!(indices == mesh.triangles.as_flattened());
    let bounds = primitive.bounding_box();
    for axis in 0..3 {
        let all = positions.iter().map(|p| p[axis]);
        assert_eq!(bounds.min[axis], all.clone().fold(f32::MAX, f32::min));
        assert_eq!(bounds.max[axis], all.fold(f32::MIN, f32::max));
    }
    for ([x, y, z], triangle) in reader.read_normals().unwrap().zip(0..) {
        assert!((x * x + y * y + z * z - 1.0).abs() < 1e-5 && y > 0.0, "vertex {triangle}: {x} {y} {z}");
    }
    let node = document.nodes().next().unwrap();
    assert_eq!(node.transform().decomposed(), ([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]));
    let asset = &document.as_json().asset;
    assert!(asset.generator.as_ref().unwrap().starts_with("Terrasoar "));

    let material = primitive.material().pbr_metallic_roughness();
    let image = material.base_color_texture().unwrap().texture().source();
    let gltf::image::Source::View { view, mime_type } = image.source() else {
        panic!("the picture is inside")
    };
    assert_eq!((mime_type, view.offset() + view.length()), ("image/png", view.offset() + texture.png.len()));
    let picture = image::load_from_memory(&blob[view.offset()..][..view.length()]).unwrap().to_rgb8();
    assert_eq!([picture.width(), picture.height()], texture.size);
    let texels: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    for ([u, v], [x, y, _]) in texels.into_iter().zip(&mesh.positions) {
        let at = |share: f32, side: u32| {
            ((f64::from(share) * f64::from(side)).floor().max(0.0) as u32).min(side - 1)
        };
        let colour = picture.get_pixel(at(u, picture.width()), at(v, picture.height())).0;
        let is_covered = (101.0..899.0).contains(x) && (1.0..599.0).contains(y);
        if is_covered {
            // A texel is half a metre; it may be the next one.
            let wanted = [(x - 100.0) * 2.0 / 8.0, y * 2.0 / 6.0];
            let near = |a: u8, b: f64| (f64::from(a) - b).abs() <= 1.5;
            assert!(
                near(colour[0], wanted[0]) && near(colour[1], wanted[1]),
                "{x},{y}: {colour:?}, not {wanted:?}"
            );
        } else if *x < 99.0 || *x > 901.0 || *y > 601.0 {
            assert_eq!(colour, [158, 156, 148], "{x},{y} lies beside the picture");
        }
    }
}

/// Less texels are those of a coarser level; a part without picture has none.
#[test]
fn textures_are_as_fine_as_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let terrain = draped(folder.path());
    let of = |part, most| Texture::of(&terrain, part, most).unwrap();
    let fine = of([200.0, 100.0, 400.0, 300.0], 4096).unwrap();
    assert_eq!((fine.size, fine.sides_m), ([400, 400], [200.0, 100.0, 400.0, 300.0]));
    let whole = of([100.0, 0.0, 900.0, 600.0], 1000).unwrap();
    assert_eq!(whole.size, [800, 600]);
    assert!(of([0.0, 650.0, 890.0, 828.0], 4096).is_none());
    assert!(of([0.0, 0.0, 50.0, 50.0], 4096).is_none());
}

/// Large coordinates are kept whole: what vertices are less of, the node adds.
#[test]
fn glb_keeps_large_coordinates_in_its_node() {
    let mesh = small();
    let foot = 0.3048;
    let map = [980_000.5, 1.0 / foot, 0.0, 200_000.25, 0.0, 1.0 / foot];
    let file = MeshFile::new(&mesh).placing(Placing { map, height_factor: 1.0 / foot });
    let bytes = written(&file, Format::Glb);
    let (document, blob) = read_glb(&bytes);
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let positions: Vec<[f32; 3]> = primitive.reader(|_| Some(&blob)).read_positions().unwrap().collect();
    let near = |a: f64, b: f64| (a - b).abs() < 0.05;
    let node = document.as_json().nodes[0].clone();
    let (scale, shift) = (node.scale.unwrap(), node.translation.unwrap());
    for (found, [east, north, up]) in positions.iter().zip(&mesh.positions) {
        let metres: [f64; 3] = std::array::from_fn(|i| f64::from(found[i] * scale[i]) + f64::from(shift[i]));
        assert!(near(metres[0], 980_000.5 * foot + east), "{metres:?}");
        assert!(near(metres[1], *up) && near(-metres[2], 200_000.25 * foot + north), "{metres:?}");
    }
    assert!(positions.iter().flatten().all(|value| value.abs() < 40.0));
    let text = 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..text]).unwrap();
    assert_eq!(json["asset"]["extras"]["Origin"], serde_json::json!([980_000.0, 200_000.0]));
}

#[test]
fn a_mesh_of_nothing_is_a_file_of_nothing() {
    let mesh = IndexedMesh::default();
    let (document, blob) = read_glb(&written(&MeshFile::new(&mesh), Format::Glb));
    assert!(blob.is_empty() && document.meshes().len() == 0 && document.nodes().len() == 1);
    assert_eq!(written(&MeshFile::new(&mesh), Format::Stl).len(), 84);
}

/// What others made is not ours.
#[test]
fn meshes_of_others_are_not_ours() {
    for start in [
        &b"ply\nformat ascii 1.0\ncomment by me\n"[..],
        b"solid hill\n",
        b"# Blender\nv 0 0 0\n",
        b"glTF\x02\0\0\0",
        b"",
    ] {
        assert!(!is_ours(start), "{start:?}");
    }
}
