//! What the graphics driver reports, in words for the user of a program.
//!
//! Its own texts are chains of causes over several lines, with labels and types in them. Only the last cause is kept, on one line.

/// An error that arrived outside a call.
pub(crate) fn of_error(error: &wgpu::Error) -> String {
    match error {
        wgpu::Error::OutOfMemory { .. } => {
            "the device has no memory left; close what else draws, or draw a smaller picture or a larger tolerance".into()
        }
        wgpu::Error::Validation { description, .. } => {
            format!(
                "a command was refused ({}). In a program of your own, check that PassFormat is what the pass has, and that the bindings are those that the material declares. In the program terrasoar it is a defect; please report it",
                last_cause(description)
            )
        }
        wgpu::Error::Internal { description, .. } => {
            format!("the driver failed ({}); a newer one may not", last_cause(description))
        }
    }
}

/// Why a device is no more.
pub(crate) fn of_loss(reason: wgpu::DeviceLostReason) -> &'static str {
    match reason {
        wgpu::DeviceLostReason::Destroyed => "it was given up",
        wgpu::DeviceLostReason::Unknown => "its driver does not say why",
    }
}

/// Names of kinds of drivers, such as `Vulkan and OpenGL`.
pub(crate) fn of_backends(backends: wgpu::Backends) -> String {
    let all = [
        (wgpu::Backends::VULKAN, "Vulkan"),
        (wgpu::Backends::METAL, "Metal"),
        (wgpu::Backends::DX12, "Direct3D 12"),
        (wgpu::Backends::GL, "OpenGL"),
    ];
    let names: Vec<&str> =
        all.iter().filter(|(bit, _)| backends.contains(*bit)).map(|(_, name)| *name).collect();
    match names[..] {
        [] => "no kind of driver that this program knows".into(),
        [ref before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        [only, ..] => only.into(),
    }
}

/// The last line of a chain of causes that says something.
pub(crate) fn last_cause(text: &str) -> String {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.next_back().unwrap_or("it does not say why").trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_line_is_left_of_a_chain_of_causes() {
        let description = "Validation Error\n\nCaused by:\n  In Device::create_buffer, label = 'vertices'\n    Buffer size 9 is too large.\n\n";
        let error = wgpu::Error::Validation { source: "x".into(), description: description.into() };
        let said = of_error(&error);
        assert!(said.contains("(Buffer size 9 is too large)") && !said.contains('\n'), "{said}");
        assert!(!said.contains("create_buffer") && !said.contains("vertices"), "{said}");
        assert_eq!(last_cause("\n \n"), "it does not say why");
        assert!(of_error(&wgpu::Error::OutOfMemory { source: "x".into() }).contains("memory"));
    }

    #[test]
    fn kinds_of_drivers_are_named() {
        assert_eq!(of_backends(wgpu::Backends::VULKAN | wgpu::Backends::GL), "Vulkan and OpenGL");
        assert_eq!(of_backends(wgpu::Backends::METAL), "Metal");
        assert_eq!(of_backends(wgpu::Backends::all()), "Vulkan, Metal, Direct3D 12 and OpenGL");
        assert!(of_backends(wgpu::Backends::empty()).contains("no kind"));
    }
}
