// The options of commands that resample raymaps, picture by picture.
#pragma once

#include "host_tool/commands/command.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/output/cube_faces.h"
#include "host_tool/output/raymap_frames.h"
#include "stitch/geometry/raymap/fisheye_picture.h"

namespace nodal::host {

/// Adds INPUT, --out, --from, --filter, --quality and --threads.
inline void add_frame_options(CLI::App& command, FrameOptions& options) {
  command.add_option("SPHERE", options.inputs, "Spheres of one size: JPEG, PNG, TIFF (8 or 16 bits), HEIF or WebP")
      ->required()
      ->type_name("");
  command
      .add_option("-o,--out", options.out,
                  "The result, .png, .tif or .raw with the sphere's bits, or .jpg with 8; %04d numbers it;\n"
                  "-: JPEGs on standard output, for | ffmpeg -f mjpeg -i - film.mp4")
      ->required()
      ->type_name("FILE");
  command
      .add_option("--from", options.from,
                  "The spheres' layout; as their metadata says when not given. Or pictures of an equidistant lens\n"
                  "with a circle of so many degrees: fisheye:fov=DEGREES; two side by side, front and back:\n"
                  "dual_fisheye:fov=DEGREES. Or faces: six files of a cube, town_right.jpg, _left, _up, _down, _front\n"
                  "and _back")
      ->type_name(layout_type())
      ->check(checked_by([](const std::string& text) -> Status {
        const auto lens = geometry::FisheyePicture::parse(text);
        if (!lens) return check_layout(text);
        return *lens ? Status{} : fail(lens->error());
      }))
      ->transform([&options](const std::string& text) {
        options.faces_in = text == kFacesWord;
        return std::string(options.faces_in ? kFacesLayout : text);
      });
  command.add_option("--filter", options.filter, "Interpolation between pixels (bicubic when not given)")
      ->type_name("nearest|bilinear|bicubic|lanczos")
      ->check(checked_by(view::parse_filter));
  command.add_option("--quality", options.quality, "JPEG quality (92 when not given)")
      ->type_name("N")
      ->check(CLI::Range(1, 100));
  command
      .add_option("--threads", options.threads,
                  "Number of threads (one for each core when not given); the result is the same")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
}

}  // namespace nodal::host
