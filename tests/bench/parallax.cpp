// Heads that do not share one nodal point, in a room with people: pictures for tests/bench/parallax to compare.
//   build/release/bin/bench_parallax FOLDER [DEGREES...]
// FOLDER gets the truth, which is what the rig's nodal point sees; for each distance of the heads from it their
// pictures and the calibration; at infinity (-far) and at the fitted distance (-near) the raymaps of each blend, each
// head's own picture on the raymap with its mask, and which head is best and which one placed seams show. With DEGREES,
// also seam and two bands with ramps of these widths.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "stitch/geometry/head.h"
#include "stitch/media/png_writer.h"
#include "stitch/offline/best_blend.h"
#include "stitch/offline/head_picture.h"
#include "stitch/offline/offline_blend.h"
#include "stitch/registration/registration.h"
#include "stitch/seams/placement.h"
#include "stitch/sets/plan_job.h"
#include "stitch/sets/seam_views.h"
#include "stitch/sets/set_blend.h"
#include "tests/support/rendered_rig.h"

namespace nodal {
namespace {

constexpr int kWidth = 1024, kHeight = 512;
constexpr int kSide = 480;

struct Picture {
  std::vector<std::uint8_t> grey;
};

const geometry::RaymapLayout& layout() {
  static const auto made = geometry::make_layout("equirectangular", kWidth, kHeight).value();
  return *made;
}

/// What the nodal point sees, with 4 x 4 rays a pixel.
Picture truth_of(const hal::sim::ScenePtr& scene) {
  constexpr int kFine = 4;
  Picture truth;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double sum = 0;
      for (int k = 0; k < kFine * kFine; ++k) {
        const Eigen::Vector3d d =
            layout().ray(x + (k % kFine + 0.5) / kFine, y + (k / kFine + 0.5) / kFine)->direction();
        const hal::sim::Light light = scene->light({d.x(), d.y(), d.z()}, 6.283 / kWidth / kFine);
        sum += std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0);
      }
      truth.grey.push_back(static_cast<std::uint8_t>(std::lround(255 * sum / (kFine * kFine))));
    }
  }
  return truth;
}

void save_png(const media::PngPicture& picture, const std::string& folder, const std::string& name) {
  const auto png = media::png_file(picture, {SampleMeaning::linear(), 0, name, {}, 6});
  if (!png) return;
  std::ofstream file(std::filesystem::path(folder) / (name + ".png"), std::ios::binary);
  file.write(reinterpret_cast<const char*>(png->data()), static_cast<std::streamsize>(png->size()));
}

void save(const Picture& picture, const std::string& folder, const std::string& name) {
  save_png({kWidth, kHeight, 1, 8, picture.grey}, folder, name);
}

/// The best head of each ray, and the head that placed seams show there (255: none).
struct Owners {
  std::vector<std::uint8_t> best, placed;
};

/// Each head's own picture on the raymap, as layer-NAME-HEAD.png and its mask.
Owners save_layers(const Calibration& rig, const std::vector<ImageView>& pictures, const seams::Labels& labels,
                   bands::Grid map, const std::string& folder, const std::string& name) {
  const bands::Grid grid{kWidth, kHeight};
  const parallel::Workers workers(0);
  const std::vector<geometry::Head> heads = geometry::make_heads(rig).value();
  constexpr std::size_t kRays = std::size_t{kWidth} * kHeight;
  Owners owners{std::vector<std::uint8_t>(kRays, 255), std::vector<std::uint8_t>(kRays, 255)};
  std::vector<float> best(kRays);
  std::vector<Picture> masks;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const offline::HeadView view(heads[h], PixelFormat::kGrey8, 1);
    const bands::Layer seen = offline::HeadPicture(view, pictures[h]).on(grid, {0, 0, kWidth, kHeight}, workers);
    Picture layer{std::vector<std::uint8_t>(kRays)}, mask = layer;
    for (std::size_t k = 0; k < kRays; ++k) {
      const float* at = seen.at(static_cast<int>(k % kWidth), static_cast<int>(k / kWidth));
      if (!(at[1] > 0)) continue;
      layer.grey[k] = static_cast<std::uint8_t>(std::lround(std::clamp(at[0], 0.0F, 255.0F)));
      mask.grey[k] = 255;
      if (at[1] > best[k]) owners.best[k] = static_cast<std::uint8_t>(h);
      best[k] = std::max(best[k], at[1]);
    }
    save(layer, folder, "layer-" + name + "-" + std::to_string(h));
    save(mask, folder, "mask-" + name + "-" + std::to_string(h));
    masks.push_back(std::move(mask));
  }
  std::vector<seams::Share> shares;
  for (std::size_t k = 0; k < kRays; ++k) {
    const double u = static_cast<double>(k % kWidth) + 0.5, v = static_cast<double>(k / kWidth) + 0.5;
    seams::shares_at(labels, map, u * map.width / kWidth, v * map.height / kHeight, shares);
    const auto sees =
        std::ranges::find_if(shares, [&](const seams::Share& share) { return masks[share.head].grey[k] > 0; });
    owners.placed[k] = sees != shares.end() ? sees->head : owners.best[k];
  }
  return owners;
}

/// A blend that the board can do; `degrees`: the width of its ramp as on the command line, empty for the default.
struct OnBoard {
  std::string name;
  Transition transition;
  std::string degrees;
};

/// Two bands with placed seams, as nodald blends the first set after its pictures moved the seams.
bool save_placed(const Calibration& rig, const test::RenderedRig& seen, const std::string& folder,
                 const std::string& name) {
  RaymapConfig config;
  config.width = kWidth;
  config.height = kHeight;
  config.format = PixelFormat::kGrey8;
  config.seams = SeamPlacement::kPlaced;
  const auto refused = [](const Error& error) { return std::fprintf(stderr, "%s\n", error.text().c_str()), false; };
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kGrey8);
  auto job = sets::PlanJob::make(rig, config, Fields::kProgressive, formats);
  if (!job) return refused(job.error());
  while (!job->tables().done()) job->tables().compile_some(64);
  auto plan = std::move(*job).finish({});
  if (!plan) return refused(plan.error());
  sets::SetBlend blend;
  blend.adopt(sets::with_memory(*plan));
  std::vector<sets::SetFrame> frames;
  for (const ImageView& frame : seen.frames()) frames.push_back({true, frame, {}, {}, {}, 0});
  blend.begin(frames, true);
  blend.run_rounds();
  const seams::Labels labels = (*plan)->seams->place(*blend.views(), {});
  auto moved = sets::with_seams(**plan, labels);
  if (!moved) return refused(moved.error());
  blend.move_seams(std::move(*moved));
  Picture raymap{std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight)};
  blend.begin_raymap(0, raymap.grey.data());
  blend.run_rounds();
  save(raymap, folder, "two-band-placed-" + name);
  return true;
}

/// The raymaps of one calibration.
bool save_raymaps(const Calibration& rig, const test::RenderedRig& seen, const std::vector<std::string>& widths,
                  const std::string& folder, const std::string& name) {
  const table::RaymapSpec spec{"equirectangular", kWidth, kHeight, PixelFormat::kGrey8};
  std::vector<OnBoard> blends{
      {"feather", Transition::kFeather, {}}, {"seam", Transition::kSeam, {}}, {"two-band", Transition::kTwoBand, {}}};
  for (const std::string& width : widths) {
    blends.push_back({"seam-" + width, Transition::kSeam, width});
    blends.push_back({"two-band-" + width, Transition::kTwoBand, width});
  }
  for (const auto& [blend, transition, degrees] : blends) {
    table::TableOptions options;
    options.transition = transition;
    options.cover = false;
    if (!degrees.empty()) options.seam_width_deg = std::strtod(degrees.c_str(), nullptr);
    const auto made = offline::OfflineBlend::make(rig, spec, options, PixelFormat::kGrey8, 0, {});
    if (!made) return std::fprintf(stderr, "%s\n", made.error().text().c_str()), false;
    save({made->blend(seen.frames()).value().bytes}, folder, blend + "-" + name);
  }
  if (!save_placed(rig, seen, folder, name)) return false;
  auto best = offline::BestBlend::make(rig, spec, 0);
  if (!best) return std::fprintf(stderr, "%s\n", best.error().text().c_str()), false;
  save({best->blend(seen.frames()).value().bytes}, folder, "best-" + name);
  const Owners owners = save_layers(rig, seen.frames(), best->labels(), best->map(), folder, name);
  save({owners.best}, folder, "owner-" + name);
  save({owners.placed}, folder, "placed_owner-" + name);
  return true;
}

int run(const std::string& folder, const std::vector<std::string>& widths) {
  std::filesystem::create_directories(folder);
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  test::Room room{test::Room::Shape::kBox, 4, {}};
  for (int k = 0; k < 8; ++k) {  // people at 1.5 m, every second one on a seam
    const double yaw = k * 0.785398;
    room.columns.push_back({1.5 * std::sin(yaw), 1.5 * std::cos(yaw), 0.25});
  }
  save(truth_of(test::what_a_rig_sees(room, {}, town)), folder, "truth");
  const Calibration one_point = test::six_fisheyes(kSide);
  for (const double off : {0.0, 0.03, 0.1, 0.3}) {
    const Calibration rig = test::spread_out(one_point, off);
    const test::RenderedRig seen = test::render_rig_in(room, rig, town, {PixelFormat::kGrey8, 1.0, 5, 3});
    char name[32];
    std::snprintf(name, sizeof name, "%.2f", off);
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      save_png({kSide, kSide, 1, 8, seen.bytes[h]}, folder, rig.heads[h].name + "-" + name);
    }
    std::ofstream(std::filesystem::path(folder) / ("rig-" + std::string(name) + ".json")) << to_json(rig);
    if (!save_raymaps(rig, seen, widths, folder, name + std::string("-far"))) return 1;
    if (off == 0) continue;
    registration::Options sought;
    sought.distance = true;
    const auto found = registration::register_heads(rig, {seen.frames()}, sought);
    Calibration fitted = rig;
    // At 0.3 m nothing but a wall agrees at any one distance: the middle of the room is given.
    fitted.distance = found && found->calibration.distance > 0 ? found->calibration.distance : 3;
    std::printf("%s m: %s %.2f m\n", name, found ? "the fitted distance is" : "not registered; given are",
                fitted.distance);
    if (!save_raymaps(fitted, seen, widths, folder, name + std::string("-near"))) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nodal

int main(int argc, char** argv) {
  if (argc >= 2) return nodal::run(argv[1], {argv + 2, argv + argc});
  std::fprintf(stderr, "usage: bench_parallax FOLDER [DEGREES...]\n");
  return 2;
}
