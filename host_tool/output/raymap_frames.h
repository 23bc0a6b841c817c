// Raymaps from files, resampled picture by picture: common to `convert` and `view`.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/rotation.h"
#include "stitch/view/resampler.h"

namespace nodal::host {

/// The options that both commands have.
struct FrameOptions {
  std::vector<std::string> inputs;
  std::string out;
  std::string from;  ///< layout of the inputs, or a geometry::FisheyePicture; empty: as their metadata says
  std::string filter = "bicubic";
  int quality = 92;
  int threads = 0;
  std::size_t pictures = 0;  ///< number of results made from one input; 0: one from each input
  bool faces_in = false;     ///< the inputs are the six faces of one cube (cube_faces.h)
  bool faces_out = false;    ///< each result is six files
};

/// What every picture becomes.
struct Outcome {
  view::Target target;
  std::optional<geometry::LayoutName> layout;  ///< layout of the result; nothing for a view
  /// The target of picture k; empty: `target`, always.
  std::function<view::Target(std::size_t k)> target_of = nullptr;
  /// The sphere is turned: `target` looks along old rays, and the metadata follow.
  std::optional<Eigen::Matrix3d> R_new_old = std::nullopt;
};

/// Reads every input, resamples it, and writes it: to files or, with --out -, as JPEGs to standard output. All inputs
/// must have the size of the first. `outcome` is called once, with the resolution of the raymaps where their pixels are
/// largest.
Status run_frames(Console& console, const FrameOptions& options,
                  const std::function<Result<Outcome>(double pixels_per_radian)>& outcome);

/// The same with pictures of `size` that `paint` makes of the inputs, whatever their layout is.
Status run_frames_as(Console& console, const FrameOptions& options, geometry::RaymapSize size,
                     const std::function<DecodedImage(const DecodedImage& raymap)>& paint);

}  // namespace nodal::host
