// The option --envelope of commands that use an envelope.
#pragma once

#include <string>

#include "host_tool/commands/command.h"
#include "stitch/geometry/envelope/envelope.h"

namespace nodal::host {

/// Adds --envelope; its help lists every shape.
CLI::Option* add_envelope_option(CLI::App& command, std::string& envelope, const std::string& what);

/// The shape with this name and sizes, or that of a mesh file, a name that ends with .obj or .glb. Errors, which name
/// the option or the file: those of read_file(), Envelope::named(), Envelope::from_obj() and mesh::decode_envelope().
Result<geometry::Envelope> read_envelope(const std::string& text);

}  // namespace nodal::host
