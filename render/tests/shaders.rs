//! Every program is valid WGSL, without a device.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use terrasoar_render::shaders::Program;

#[test]
fn all_programs_are_valid() {
    for program in Program::ALL {
        let source = program.source();
        let module = naga::front::wgsl::parse_str(source)
            .unwrap_or_else(|e| panic!("{program:?}: {}", e.emit_to_string(source)));
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{program:?}: {}", e.emit_to_string(source)));
    }
}

#[test]
fn every_entry_point_is_there() {
    let names: Vec<String> = Program::ALL
        .iter()
        .flat_map(|p| naga::front::wgsl::parse_str(p.source()).unwrap().entry_points)
        .map(|e| e.name)
        .collect();
    for name in [
        "shared_vertex",
        "shared_fragment",
        "own_vertex",
        "own_fragment",
        "wall_vertex",
        "wall_fragment",
        "sky_vertex",
        "sky_fragment",
        "scatter_vertices",
        "scatter_triangles",
        "morph_start",
        "morph_step",
    ] {
        assert!(names.iter().any(|n| n == name), "{name}");
    }
}
