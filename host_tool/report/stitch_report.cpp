#include "host_tool/report/stitch_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "protocol/base/angles.h"
#include "stitch/geometry/raymap/layout_window.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/image_file.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/parallel/workers.h"
#include "stitch/view/camera.h"
#include "stitch/view/resampler.h"

namespace nodal::host {
namespace {

using offline::SeamCheck;
using offline::SeamPlace;
using offline::SeamVerdict;

constexpr int kSphereWidth = 2048;   // px
constexpr int kCropSide = 320;       // px
constexpr double kMaxCropDeg = 100;  // field of view of a crop of a small sphere
constexpr std::size_t kMaxCrops = 6;
constexpr std::size_t kMaxRows = 40;  // rows of the table of seams

std::vector<std::uint8_t> jpeg(const DecodedImage& picture) {
  std::vector<std::uint8_t> file;
  media::JpegWriter writer({picture.format, picture.width, picture.height});
  // A page without a picture still says everything.
  if (!writer.write(picture.view(), "", file)) file.clear();
  return file;
}

/// Pictures made from a sphere.
bool is_whole(const StitchedSphere& sphere) {
  return sphere.raymap.width == sphere.layout.width() && sphere.raymap.height == sphere.layout.height();
}

class Pictures {
 public:
  explicit Pictures(const StitchedSphere& sphere)
      : readable_(sphere.raymap.format == PixelFormat::kI420
                      ? media::convert_image(sphere.raymap.view(), PixelFormat::kRgb24)
                      : DecodedImage{}),
        raymap_(readable_.bytes.empty() ? sphere.raymap : readable_),
        window_(sphere.layout, sphere.part ? sphere.part->x : 0, sphere.part ? sphere.part->y : 0, sphere.raymap.width,
                sphere.raymap.height),
        resampler_(is_whole(sphere) ? sphere.layout : window_, view::Filter::kBilinear, workers_) {}

  std::vector<std::uint8_t> of(const view::Target& target) const {
    const DecodedImage made = resampler_.resample(raymap_.view(), target, workers_);
    return jpeg(is_linear16(made.format) ? media::shown_in_8_bits(made) : made);
  }

 private:
  parallel::Workers workers_{0};
  DecodedImage readable_;
  const DecodedImage& raymap_;
  geometry::LayoutWindow window_;
  view::Resampler resampler_;
};

view::Target whole(const StitchedSphere& sphere) {
  if (!sphere.part) {
    const auto ray = [](double x, double y) -> std::optional<geometry::Ray> {
      return geometry::Ray::at({(x / kSphereWidth - 0.5) * 2 * kPi, (y * 2 / kSphereWidth - 0.5) * kPi});
    };
    return {kSphereWidth, kSphereWidth / 2, ray};
  }
  const bands::Window& part = *sphere.part;
  const double scale = std::min(1.0, static_cast<double>(kSphereWidth) / part.width);
  const int width = std::max(1, static_cast<int>(part.width * scale));
  const int height = std::max(1, static_cast<int>(part.height * scale));
  const auto ray = [=, full_width = sphere.layout.width(), full_height = sphere.layout.height()](
                       double x, double y) -> std::optional<geometry::Ray> {
    const double u = (part.x + x * part.width / width) / full_width,
                 v = (part.y + y * part.height / height) / full_height;
    return geometry::Ray::at({(u - 0.5) * 2 * kPi, (v - 0.5) * kPi});
  };
  return {width, height, ray};
}

/// A look through a camera at a place of the sphere, as large as the raymap has it.
std::optional<view::Target> crop(const StitchedSphere& sphere, const geometry::Angles& at) {
  const double pixel = std::sqrt(4 * kPi / (static_cast<double>(sphere.layout.width()) * sphere.layout.height()));
  view::CameraSpec spec;
  spec.pose = {at.theta * kDegreesPerRadian, -at.phi * kDegreesPerRadian, 0};
  spec.fov_deg = std::clamp(kCropSide * pixel * kDegreesPerRadian, 2.0, kMaxCropDeg);
  spec.width = spec.height = kCropSide;
  const Result<view::Camera> camera = view::Camera::make(spec);
  if (!camera) return std::nullopt;
  return view::Target{kCropSide, kCropSide, [camera = *camera](double x, double y) { return camera.ray(x, y); }};
}

/// Left, top, width and height of what is shown, as shares of the whole sphere.
std::array<double, 4> part_of(const StitchedSphere& sphere) {
  if (!sphere.part) return {0, 0, 1, 1};
  const double width = sphere.layout.width(), height = sphere.layout.height();
  return {sphere.part->x / width, sphere.part->y / height, sphere.part->width / width, sphere.part->height / height};
}

void add_crops(const StitchedSphere& sphere, const Pictures& pictures, HtmlReport& page) {
  std::vector<std::pair<std::vector<std::uint8_t>, std::string>> shown;
  for (const SeamCheck& seam : sphere.verdict.seams) {
    const SeamPlace* const place = offline::worst_place(seam);
    if (place == nullptr || offline::verdict_of(seam) == SeamVerdict::kGood || shown.size() == kMaxCrops) continue;
    const std::optional<view::Target> target = crop(sphere, place->at);
    if (!target) continue;
    std::vector<std::uint8_t> picture = pictures.of(*target);
    if (picture.empty()) continue;
    shown.emplace_back(std::move(picture), fmt::format("{} and {}, {}: {}", sphere.heads[seam.a], sphere.heads[seam.b],
                                                       text_of(place->at), text_of(seam)));
  }
  if (shown.empty()) return;
  page.heading("Seams that deserve a look");
  page.paragraph("The sphere at its full size, with the worst place of each seam in the middle.");
  page.pictures(shown);
}

void add_advice(const StitchedSphere& sphere, HtmlReport& page) {
  if (sphere.verdict.word == SeamVerdict::kGood) return;
  page.heading("What to do");
  page.paragraph(
      "Things close by look different from places that are some centimetres apart: turn the camera about its lens, "
      "not about yourself, and keep tripods, hands and people out of the overlaps.");
  page.paragraph(
      "Things that moved between two pictures are cut at a seam: take that pair again. Let pictures overlap by a "
      "third, with something in the overlap that has edges; blue sky has nothing by which pictures can be matched.");
  page.paragraph(
      "The seams count at the size of this sphere: in a smaller one (--width) the same jump is smaller, too.");
}

std::string capitalized(std::string text) {
  if (!text.empty() && text.front() >= 'a' && text.front() <= 'z') text.front() = static_cast<char>(text.front() - 32);
  return text;
}

/// A note as a sentence: with a capital letter, if it does not begin with a name.
std::string sentence(const std::string& note) {
  const std::string word = note.substr(0, note.find(' '));
  const bool plain = std::ranges::all_of(word, [](char c) { return c >= 'a' && c <= 'z'; });
  return (plain ? capitalized(note) : note) + '.';
}

void add_table(const StitchedSphere& sphere, HtmlReport& page) {
  std::vector<std::vector<std::string>> rows;
  for (const SeamCheck& seam : sphere.verdict.seams) {
    if (rows.size() == kMaxRows) break;
    rows.push_back({sphere.heads[seam.a], sphere.heads[seam.b], name_of(offline::verdict_of(seam)),
                    fmt::format("{:.1f}", offline::usual_jump(seam)), fmt::format("{:.1f}", offline::usual_bend(seam)),
                    fmt::format("{:.0f}", seam.step_levels),
                    fmt::format("{} of {}", seam.places.size(), seam.looked_at)});
  }
  HtmlReport table("", "");
  table.paragraph(fmt::format(
      "At places along each seam, the two pictures are laid over each other and shifted until they look alike. A seam "
      "is good if that takes at most {} pixels of this sphere at nine places out of ten, and usable up to {}, or "
      "if lines were bent by more than {} so that they go on.",
      offline::kFinePx, offline::kBrokenPx, offline::kFineBendPx));
  table.table(
      {"picture", "and", "", "lines jump by, px", "bent by, px", "brighter by, levels of 255", "places with detail"},
      rows);
  page.details("All seams", table);
}

}  // namespace

HtmlReport stitch_report(const StitchedSphere& sphere) {
  HtmlReport page(fmt::format("Sphere of {} pictures", sphere.heads.size()),
                  capitalized(sphere.verdict.sentence) + ".");
  const Pictures pictures(sphere);
  if (std::vector<std::uint8_t> picture = pictures.of(whole(sphere)); !picture.empty()) {
    page.sphere(picture, "The sphere", part_of(sphere));
  }
  add_crops(sphere, pictures, page);
  add_advice(sphere, page);
  if (!sphere.confidence.empty() || !sphere.notes.empty()) page.heading("What was found");
  if (!sphere.confidence.empty()) page.paragraph(capitalized(sphere.confidence) + ".");
  for (const std::string& note : sphere.notes) page.warning(sentence(note));
  add_table(sphere, page);
  return page;
}

}  // namespace nodal::host
