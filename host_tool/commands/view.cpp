#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/envelope_option.h"
#include "host_tool/commands/frame_options.h"
#include "host_tool/console/files.h"
#include "protocol/base/try.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/geometry/raymap/fisheye_picture.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/mesh/rasteriser.h"
#include "stitch/view/camera.h"
#include "stitch/view/camera_path.h"

namespace nodal::host {
namespace {

struct ViewArgs {
  FrameOptions frames;
  std::string camera = "perspective";
  std::string size = "1920x1080";
  std::string envelope, mesh, eye, path;
  view::CameraSpec spec;
};

/// The cameras' names with `between` between them; `after` the fifth a line ends.
std::string camera_words(const std::string& between, const std::string& after) {
  std::string words;
  std::size_t count = 0;
  for (const std::string_view name : view::camera_names()) {
    if (count > 0) words += count % 5 == 0 ? after : between;
    words += name, ++count;
  }
  return words;
}

constexpr int kMaxSide = 16384;

Result<geometry::RaymapSize> parse_view_size(const std::string& text) { return parse_size(text, kMaxSide); }

Result<Eigen::Vector3d> parse_eye(const std::string& text) {
  Eigen::Vector3d eye;
  const char *from = text.data(), *end = text.data() + text.size();
  for (int k = 0; k < 3; ++k) {
    const auto [at, error] = std::from_chars(from, end, eye[k]);
    if (error != std::errc() || (k < 2 ? at == end || *at != ',' : at != end) || !(std::abs(eye[k]) <= 1e6)) {
      return fail(Errc::kBadValue, fmt::format("'{}': write X,Y,Z, metres to the right, down and forward", text));
    }
    from = at + 1;
  }
  return eye;
}

/// As textured triangles.
Status run_mesh_view(Context& context, const ViewArgs& args, const view::CameraSpec& spec) {
  const Result<mesh::MeshFormat> format = mesh::mesh_format_of_name(args.mesh);
  if (!format) return fail(format.error().in("--mesh"));
  const Result<std::string> bytes = read_file(args.mesh, mesh::kMaxMeshFileBytes);
  if (!bytes) return fail(bytes.error().in("--mesh"));
  const auto read = mesh::decode_mesh({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()}, *format);
  if (!read) return fail(read.error().in(args.mesh).in("--mesh"));
  const Eigen::Vector3d eye = args.eye.empty() ? Eigen::Vector3d::Zero() : parse_eye(args.eye).value();
  const parallel::Workers workers(args.frames.threads);
  const auto seen = mesh::MeshView::make(*read, spec, eye, workers);
  if (!seen) return fail(seen.error().in("--camera"));
  // The mesh says where everything is; of the layout, only whether pixels beside each other belong together matters.
  bool scattered = false;
  if (!args.frames.from.empty() && !geometry::FisheyePicture::parse(args.frames.from)) {
    const Result<geometry::LayoutName> from = layout_named(args.frames.from);
    if (!from) return fail(from.error().in("--from"));
    const geometry::RaymapSize any = from->size_for_width(64);
    scattered = geometry::make_layout(*from, any.width, any.height).value()->scattered();
  }
  return run_frames_as(context.console(), args.frames, {spec.width, spec.height},
                       [&](const DecodedImage& raymap) { return seen->paint(raymap.view(), scattered, workers); });
}

/// A camera path whose keys all have a field of view that the camera can show.
Result<view::CameraPath> read_path(const std::string& file, const view::CameraSpec& of) {
  constexpr std::uint64_t kMaxBytes = 16 << 20;
  NODAL_TRY_ASSIGN(const std::string text, read_file(file, kMaxBytes));
  NODAL_TRY_ASSIGN(view::CameraPath path, view::CameraPath::parse(text));
  for (const view::CameraKey& key : path.keys()) {
    view::CameraSpec spec = of;
    spec.fov_deg = key.fov_deg;
    const Result<view::Camera> camera = view::Camera::make(spec);
    if (!camera) return fail(camera.error().in(fmt::format("picture {}", key.picture)));
  }
  return path;
}

/// The camera in picture k.
view::CameraSpec along(view::CameraSpec spec, const view::CameraPath& path, std::size_t k) {
  const view::CameraKey key = path.at(static_cast<std::int64_t>(k));
  spec.pose = key.pose;
  spec.fov_deg = key.fov_deg;
  return spec;
}

Status run_view(Context& context, const ViewArgs& args) {
  if (!args.eye.empty() && args.envelope.empty() && args.mesh.empty())
    return fail(Errc::kMissingField, "--eye: how far away things are is not known; give --envelope or --mesh");
  view::CameraSpec spec = args.spec;
  spec.name = view::parse_camera(args.camera).value();
  const geometry::RaymapSize size = parse_view_size(args.size).value();
  spec.width = size.width;
  spec.height = size.height;
  if (!args.mesh.empty()) return run_mesh_view(context, args, spec);
  std::optional<view::CameraPath> path;
  if (!args.path.empty()) {
    Result<view::CameraPath> read = read_path(args.path, spec);
    if (!read) return fail(read.error().in(args.path).in("--path"));
    path = std::move(*read);
    spec = along(spec, *path, 0);
  }
  Result<view::Camera> camera = view::Camera::make(spec);
  if (!camera) return fail(camera.error().in("--fov"));
  view::Target target{spec.width, spec.height, [&](double x, double y) { return camera->ray(x, y); }, 0, true};
  std::optional<geometry::Envelope> envelope;
  if (!args.envelope.empty()) {
    NODAL_TRY_ASSIGN(geometry::Envelope read, read_envelope(args.envelope));
    envelope.emplace(std::move(read));
    const Eigen::Vector3d eye = args.eye.empty() ? Eigen::Vector3d::Zero() : parse_eye(args.eye).value();
    if (const Status inside = envelope->check_eye(eye); !inside) return fail(inside.error().in("--eye"));
    target.ray = [&, eye](double x, double y) -> std::optional<geometry::Ray> {
      const std::optional<geometry::Ray> ray = camera->ray(x, y);
      const std::optional<Eigen::Vector3d> point = ray ? envelope->seen(eye, *ray) : std::nullopt;
      return point ? std::optional(geometry::Ray::towards(*point)) : std::nullopt;
    };
    target.smooth = false;  // not at the edges of a mesh
  }
  FrameOptions frames = args.frames;
  if (path && frames.inputs.size() == 1) frames.pictures = static_cast<std::size_t>(path->keys().back().picture) + 1;
  return run_frames(context.console(), frames, [&](double) -> Result<Outcome> {
    Outcome outcome{target, std::nullopt};
    if (path) {
      outcome.target_of = [&](std::size_t k) {
        // Cannot fail: a field of view is between those of two keys.
        camera = view::Camera::make(along(spec, *path, k));
        return target;
      };
    }
    return outcome;
  });
}

}  // namespace

void add_view(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "view", "Look into spheres with a virtual camera; needs no rig",
                  "  nodal view sphere.jpg -o view.jpg --yaw 30 --pitch -10 --fov 75\n"
                  "  nodal view cube.png --from cube -o planet.png --camera stereographic --pitch -90 \\\n"
                  "      --fov 300 --size 1500x1500\n"
                  "  nodal view r-*.jpg -o v-%04d.jpg\n"
                  "  nodal view sphere.jpg -o - --path turn.csv | ffmpeg -f mjpeg -r 30 -i - turn.mp4\n"
                  "  nodal view hall.jpg -o near.jpg --envelope hall.glb --eye 0,0,3\n"
                  "  nodal view cube.jpg -o view.jpg --mesh cube.glb\n"
                  "  nodal view hall.jpg -o ball.jpg --envelope icosahedron:1 --eye 0,0,-3\n"
                  "Where the camera shows nothing, beyond 180 degrees from its axis or beside an envelope that it\n"
                  "sees from outside, the view is black.\n");
  auto args = std::make_shared<ViewArgs>();
  add_frame_options(*command, args->frames);
  command
      ->add_option(
          "--camera", args->camera,
          "perspective when not given. One of: " + camera_words(" ", "\n") +
              "\nfisheye:f1=F1,f2=F2,... to f9: the angle a from the axis at F1 a + F2 a^2 + ...; fisheye: at a"
              "\npannini:d=D with D from 0, perspective, to 100; 1 when not given")
      ->type_name("NAME:" + camera_words("|", "|"))
      ->check(checked_by(view::parse_camera));
  CLI::Option* const yaw =
      command->add_option("--yaw", args->spec.pose.yaw, "Direction of view: to the right (0 when not given)");
  yaw->type_name("DEGREES")->check(CLI::Range(-360.0, 360.0));
  CLI::Option* const pitch =
      command->add_option("--pitch", args->spec.pose.pitch, "Direction of view: up (0 when not given)");
  pitch->type_name("DEGREES")->check(CLI::Range(-90.0, 90.0));
  CLI::Option* const roll =
      command->add_option("--roll", args->spec.pose.roll, "Camera turned clockwise (0 when not given)");
  roll->type_name("DEGREES")->check(CLI::Range(-360.0, 360.0));
  CLI::Option* const fov = command->add_option("--fov", args->spec.fov_deg,
                                               "Field of view, from the left to the right edge (90 when not given)");
  fov->type_name("DEGREES");
  command->add_option("--size", args->size, "Size of the view, px (1920x1080 when not given)")
      ->type_name("WIDTHxHEIGHT")
      ->check(checked_by(parse_view_size));
  CLI::Option* const envelope =
      add_envelope_option(*command, args->envelope, "How far away the things are that the sphere shows");
  command
      ->add_option("--mesh", args->mesh,
                   "Draw the textured triangles of a mesh in place of the sphere's layout: .obj, .glb or .mshp")
      ->type_name("FILE")
      ->excludes(envelope);
  command
      ->add_option("--eye", args->eye, "Where the camera is, metres to the right, down and forward of the nodal point")
      ->type_name("X,Y,Z")
      ->check(checked_by(parse_eye));
  CLI::Option* const path =
      command->add_option("--path", args->path,
                          "The camera moves. Lines picture,yaw,pitch,roll,fov; smooth between them. Of one sphere,\n"
                          "pictures up to the last line's; of several, one each");
  path->type_name("FILE");
  for (CLI::Option* const fixed : {yaw, pitch, roll, fov}) path->excludes(fixed);
  path->excludes("--mesh");
  line.on(command, [args](Context& context) { return run_view(context, *args); });
}

}  // namespace nodal::host
