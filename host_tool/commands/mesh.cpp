#include <fmt/format.h>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/envelope_option.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/console/console.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/mesh/of_layout.h"

namespace nodal::host {
namespace {

constexpr double kExactDeg = 1e-6;  // a smaller error is rounding

struct MeshArgs {
  std::string layout = "equirectangular";
  std::string size, out, texture;
  std::string envelope = "sphere:1";
  double error_deg = 0.1;
};

Status run_mesh(Context& context, const MeshArgs& args) {
  Console& console = context.console();
  const Result<mesh::MeshFormat> format = mesh::mesh_format_of_name(args.out);
  if (!format) return fail(format.error().in("--out"));
  if (!args.texture.empty() && *format != mesh::MeshFormat::kGlb)
    return fail(Errc::kBadValue, "--texture: only a .glb refers to a picture");
  const geometry::RaymapSize size = parse_size(args.size, geometry::kMaxRaymapSide).value();
  const Result<geometry::LayoutName> name = layout_named(args.layout);
  if (!name) return fail(name.error().in("--layout"));
  const auto layout = geometry::make_layout(*name, size.width, size.height);
  if (!layout) return fail(layout.error().in("--layout"));
  NODAL_TRY_ASSIGN(const geometry::Envelope envelope, read_envelope(args.envelope));
  const auto made =
      interruptible(console, [&] { return mesh::mesh_of_layout(**layout, envelope, args.error_deg * kPi / 180); });
  if (!made) return fail(made.error().in("--error"));
  const auto bytes = mesh::encode_mesh(made->mesh, *format, args.texture);
  if (!bytes) return fail(bytes.error().in(args.out));
  NODAL_TRY(write_file(args.out, *bytes));
  const double error_deg = made->error * 180 / kPi, ratio = mesh::edge_ratio(made->mesh);
  console.document({{"out", args.out},
                    {"layout", name->text()},
                    {"vertices", made->mesh.vertices.size()},
                    {"triangles", made->mesh.triangles.size()},
                    {"error_deg", error_deg},
                    {"edge_ratio", ratio}});
  console.line(fmt::format(
      "{}: {} triangles, {} vertices; directions are {}; the longest edge is {:.2f} times the shortest", args.out,
      made->mesh.triangles.size(), made->mesh.vertices.size(),
      error_deg < kExactDeg ? std::string("exact") : fmt::format("wrong by at most {:.3g}°", error_deg), ratio));
  return {};
}

}  // namespace

void add_mesh(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "mesh", "Make the triangle mesh that shows spheres of a layout in other programs; needs no rig",
                  "  nodal mesh --size 3840x1920 -o sphere.glb --texture sphere.jpg\n"
                  "  nodal mesh --layout cube --size 3072x2048 -o cube.mshp --error 0.5\n"
                  "  nodal mesh --layout hammersley --size 256x128 -o points.obj --envelope hall.obj\n"
                  "Its triangles say where in the sphere each direction is. `nodal view --mesh` reads it.\n");
  auto args = std::make_shared<MeshArgs>();
  command->add_option("-o,--out", args->out, "The mesh: .obj, .glb (glTF 2.0), or .mshp (spherical video)")
      ->required()
      ->type_name("FILE");
  add_layout_option(*command, args->layout, "Layout of the spheres (equirectangular when not given)");
  command->add_option("--size", args->size, "Size of the spheres, px")
      ->required()
      ->type_name("WIDTHxHEIGHT")
      ->check(checked_by([](const std::string& text) { return parse_size(text, geometry::kMaxRaymapSide); }));
  command->add_option("--error", args->error_deg, "How far directions may be off between corners (0.1 when not given)")
      ->type_name("DEGREES")
      ->check(CLI::Range(0.001, 45.0));
  add_envelope_option(*command, args->envelope, "The surface that the triangles are on (sphere:1 when not given)");
  command->add_option("--texture", args->texture, "The name of the sphere's picture, which a .glb refers to")
      ->type_name("NAME");
  line.on(command, [args](Context& context) { return run_mesh(context, *args); });
}

}  // namespace nodal::host
