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

/// What a wrong text of a material is told.
fn said(text: &str) -> String {
    terrasoar_render::Material::new(text).map_or_else(|e| e.to_string(), |_| "nothing".into())
}

#[test]
fn a_wrong_material_is_told_its_line_and_fault() {
    let function = "fn material(at: GroundPoint) -> vec4<f32> {\n    return vec4(0.5);\n}\n";
    assert_eq!(said(function), "nothing");
    let wrong: &[(String, &str, &str)] = &[
        ("fn material(at: GroundPoint) -> vec4<f32> {\n    return vec4(0.5;\n}".into(), "line 2", "expected"),
        (function.replace("0.5", "at.hight_m"), "line 2", "hight_m"),
        (function.replace("vec4(0.5)", "vec3(0.5)"), "line 2", "vec4<f32>"),
        (format!("{function}\nfn light(a: f32) -> f32 {{ return a; }}"), "line 5", "light"),
        (String::new(), "line 1", "needs a function `fn material(at: GroundPoint) -> vec4<f32>`"),
        ("fn surface() -> f32 { return 1.0; }".into(), "line 1", "needs a function"),
        ("fn material() -> vec4<f32> { return vec4(0.0); }".into(), "line 1", "needs a function"),
        (
            "fn material(at: GroundPoint) -> vec3<f32> { return vec3(0.0); }".into(),
            "line 1",
            "needs a function",
        ),
        (format!("override own_a: f32 = 1.0;\n{function}"), "line 1", "const"),
        (format!("\n@group(0) @binding(60) var own_t: texture_2d<f32>;\n{function}"), "line 2", "group 1"),
        (format!("@group(2) @binding(0) var own_t: texture_2d<f32>;\n{function}"), "line 1", "group 2"),
        (
            format!(
                "@group(1) @binding(0) var own_t: texture_2d<f32>;\n@group(1) @binding(0) var own_u: texture_2d<f32>;\n{function}"
            ),
            "line 2",
            "twice",
        ),
        (
            format!("@group(1) @binding(0) var<storage, read_write> own_b: array<f32>;\n{function}"),
            "line 1",
            "read-only",
        ),
        (
            format!("@group(1) @binding(0) var own_t: texture_storage_2d<r32float, write>;\n{function}"),
            "line 1",
            "read-only",
        ),
        (format!("var<workgroup> own_w: f32;\n{function}"), "line 1", "not possible"),
    ];
    for (text, line, words) in wrong {
        let said = said(text);
        assert!(
            said.starts_with(line) && said.to_lowercase().contains(&words.to_lowercase()),
            "{text}\n{said}"
        );
        assert!(
            said.contains(" of the material: ") && !said.contains('\n') && !said.contains('['),
            "{text}\n{said}"
        );
    }
}
