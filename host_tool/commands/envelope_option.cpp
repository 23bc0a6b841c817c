#include "host_tool/commands/envelope_option.h"

#include "host_tool/console/files.h"

namespace nodal::host {

CLI::Option* add_envelope_option(CLI::App& command, std::string& envelope, const std::string& what) {
  std::string shapes = geometry::Solid::names();
  // Two lines: a line of the help has about 80 columns.
  shapes[shapes.find(" tetrahedron")] = '\n';
  return command
      .add_option("--envelope", envelope,
                  what + ". A closed mesh around the nodal point,\nFILE.obj, or a shape about it, metres:\n" + shapes)
      ->type_name("SHAPE|FILE.obj");
}

Result<geometry::Envelope> read_envelope(const std::string& text) {
  if (!text.ends_with(".obj")) {
    Result<geometry::Envelope> shape = geometry::Envelope::named(text);
    if (!shape) return fail(shape.error().in("--envelope"));
    return shape;
  }
  const Result<std::string> bytes = read_file(text, geometry::Envelope::kMaxObjBytes);
  if (!bytes) return fail(bytes.error().in("--envelope"));
  Result<geometry::Envelope> envelope = geometry::Envelope::from_obj(*bytes);
  if (!envelope) return fail(envelope.error().in(text).in("--envelope"));
  return envelope;
}

}  // namespace nodal::host
