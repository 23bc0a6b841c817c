#include "host_tool/commands/envelope_option.h"

#include "host_tool/console/files.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/mesh/mesh_file.h"

namespace nodal::host {
namespace {

bool is_mesh_file(const std::string& text) { return has_ending(text, ".glb") || has_ending(text, ".obj"); }

Result<geometry::Envelope> shape_named(const std::string& text) {
  if (text.find(':') == std::string::npos && text.find_first_of("./") != std::string::npos) {
    return fail(
        Errc::kUnsupported,
        text.substr(0, 256) + ": the name of a mesh ends with .obj or .glb; convert other files to one of them");
  }
  return geometry::Envelope::named(text);
}

}  // namespace

CLI::Option* add_envelope_option(CLI::App& command, std::string& envelope, const std::string& what) {
  std::string shapes = geometry::Solid::names();
  // Two lines: a line of the help has about 80 columns.
  shapes[shapes.find(" tetrahedron")] = '\n';
  return command
      .add_option("--envelope", envelope,
                  what +
                      ". A closed mesh around the nodal point,\nFILE.obj or FILE.glb, or a shape about it, metres:\n" +
                      shapes)
      ->type_name("SHAPE|FILE")
      ->check(checked_by([](const std::string& text) -> Status {
        if (is_mesh_file(text)) return {};
        const Result<geometry::Envelope> shape = shape_named(text);
        return shape ? Status{} : fail(shape.error());
      }));
}

Result<geometry::Envelope> read_envelope(const std::string& text) {
  if (!is_mesh_file(text)) {
    Result<geometry::Envelope> shape = shape_named(text);
    if (!shape) return fail(shape.error().in("--envelope"));
    return shape;
  }
  const bool glb = has_ending(text, ".glb");
  NODAL_TRY_ASSIGN(const std::string bytes,
                   read_file(text, glb ? mesh::kMaxMeshFileBytes : geometry::Envelope::kMaxObjBytes));
  Result<geometry::Envelope> envelope =
      glb ? mesh::decode_envelope({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()})
          : geometry::Envelope::from_obj(bytes);
  if (!envelope) return fail(envelope.error().in(text));
  return envelope;
}

}  // namespace nodal::host
