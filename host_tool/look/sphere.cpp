#include "host_tool/look/sphere.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "host_tool/console/files.h"
#include "host_tool/input/pictures.h"
#include "host_tool/look/numbers.h"
#include "host_tool/look/shrink.h"
#include "host_tool/output/raymap_source.h"
#include "protocol/base/try.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/raymap/raymap_file.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/mesh/of_layout.h"
#include "stitch/view/resampler.h"

namespace nodal::host::look {
namespace {

using Json = nlohmann::ordered_json;

// The error of triangles: a small part of a pixel, as long as the mesh stays small.
constexpr double kPixelsOff = 0.1, kMinErrorDeg = 0.02, kMaxErrorDeg = 0.2;
constexpr double kCoarsest = 5 * std::numbers::pi / 180;  // rad, where fewer triangles are needed
constexpr int kQuality = 95;                              // JPEG quality of pictures that are encoded again

Answer refused(const Error& error) { return Answer::text(500, error.message); }

/// "image/jpeg" or "image/png" if browsers show the file's numbers as this program reads them; otherwise empty.
std::string type_for_browsers(const std::string& file, const std::vector<std::uint8_t>& bytes) {
  Result<media::PictureBytes> opened = media::PictureBytes::open(file);
  if (!opened || bytes.size() < 4) return "";
  const Result<ImageHeader> header = read_picture_header(*opened);
  if (!header || header->deep || media::needs_conversion(header->meaning) || header->meaning.alpha) return "";
  if (!header->meaning.icc.empty() || !header->meaning.unread.empty()) return "";
  const media::Exif exif = media::exif_of(header->metadata);
  if (exif.orientation != 1 || exif.adobe_rgb) return "";  // browsers turn pictures by their Exif
  if (bytes[0] == 0xFF && bytes[1] == 0xD8) return "image/jpeg";
  return bytes[0] == 0x89 && bytes[1] == 'P' ? "image/png" : "";
}

/// A raymap without triangles of its own as an equirectangular one of the same resolution.
struct Resampled {
  DecodedImage picture;
  std::unique_ptr<geometry::RaymapLayout> layout;
};
Resampled as_equirectangular(const DecodedImage& picture, const RaymapSource& source, int threads) {
  const geometry::LayoutName name = geometry::LayoutName::parse("equirectangular").value();
  const geometry::RaymapSize size = name.size_for_width(name.width_for_resolution(source.pixels_per_radian));
  const parallel::Workers workers(threads);
  Resampled made;
  made.layout = geometry::make_layout(name, size.width, size.height).value();
  const view::Resampler resampler(*source.layout, view::Filter::kBilinear, workers);
  made.picture = resampler.resample(picture.view(), view::Target::of(*made.layout), workers);
  made.picture.meaning = picture.meaning;
  return made;
}

}  // namespace

std::vector<NamedEnvelope> usual_envelopes() {
  std::vector<NamedEnvelope> all;
  for (const auto& [title, option] :
       {std::pair{"sphere", "sphere:1"}, std::pair{"cube", "cube:1.4"}, std::pair{"dodecahedron", "dodecahedron:1.1"},
        std::pair{"icosahedron", "icosahedron:1.1"}, std::pair{"paraboloid", "paraboloid:1"},
        std::pair{"cylinder", "cylinder:0.8,1.4"}}) {
    all.push_back({title, option, geometry::Envelope::named(option).value()});
  }
  return all;
}

Result<std::unique_ptr<Sphere>> Sphere::read(const Options& options) {
  std::unique_ptr<Sphere> made(new Sphere(options));
  NODAL_TRY(made->arrange());
  if (made->flat_.empty()) made->mesh(0);  // the page asks for it first
  return made;
}

Result<RaymapInput> Sphere::read_input() {
  film_ = options_.film;
  if (film_ == nullptr && !is_film(options_.file)) return read_raymap(options_.file, options_.from.empty());
  if (film_ == nullptr) {
    NODAL_TRY_ASSIGN(film_, open_film(options_.file));
  }
  NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> first, film_->frame(0));
  NODAL_TRY_ASSIGN(DecodedImage picture, media::decode_image(first, options_.file, PixelFormat::kRgb24));
  if (options_.from.empty()) options_.from = film_->layout();
  return RaymapInput{std::move(picture), false};
}

/// The file's own bytes, if browsers show them as they are to be seen.
void Sphere::keep_stored() {
  const Result<std::string> bytes = read_file(options_.file, media::kMaxImageFileBytes);
  if (!bytes) return;
  std::vector<std::uint8_t> own(bytes->begin(), bytes->end());
  stored_type_ = type_for_browsers(options_.file, own);
  const Result<ImageHeader> header = [&]() -> Result<ImageHeader> {
    NODAL_TRY_ASSIGN(media::PictureBytes opened, media::PictureBytes::open(options_.file));
    return read_picture_header(opened);
  }();
  const bool whole = header && header->width == width_ && header->height == height_;
  if (!stored_type_.empty() && whole) stored_ = std::make_shared<const std::vector<std::uint8_t>>(std::move(own));
}

Status Sphere::arrange() {
  NODAL_TRY_ASSIGN(RaymapInput input, read_input());
  NODAL_TRY_ASSIGN(RaymapSource source, source_of(options_.from, options_.file, input));
  width_ = input.picture.width;
  height_ = input.picture.height;
  layout_name_ = source.name ? source.name->text() : options_.from;
  if (const std::string warning = shape_warning(options_.file, source, input); !warning.empty())
    notes_.push_back(warning);
  picture_ = is_linear16(input.picture.format) ? media::shown_in_8_bits(input.picture) : std::move(input.picture);
  if (const std::int64_t rays = std::int64_t{width_} * height_;
      source.layout->scattered() && rays > kMaxScatteredRays) {
    flat_ = fmt::format(
        "The layout {} has no order, and this file has {} rays: more than the {} that are shown as a sphere. It is "
        "shown flat; `nodal convert --layout equirectangular` makes a file that is shown as one.",
        layout_name_, rays, kMaxScatteredRays);
    notes_.push_back(flat_);
    layout_ = std::move(source.layout);
    return {};
  }
  if (source.layout->patches().empty()) {
    if (film_ != nullptr) {
      return fail(Errc::kUnsupported,
                  fmt::format("{}: films of the layout {} are not shown; render one of another layout", options_.file,
                              layout_name_));
    }
    Resampled made = as_equirectangular(picture_, source, options_.threads);
    picture_ = std::move(made.picture);
    layout_ = std::move(made.layout);
    notes_.push_back(fmt::format("{} is shown by way of an equirectangular picture of {}x{} px, interpolated {}",
                                 layout_name_, picture_.width, picture_.height,
                                 source.layout->scattered() ? "between natural neighbours" : "between its pixels"));
  } else {
    layout_ = std::move(source.layout);
    if (film_ == nullptr) keep_stored();
  }
  const double pixel_deg = 180 / std::numbers::pi / source.pixels_per_radian;
  most_error_ = std::clamp(kPixelsOff * pixel_deg, kMinErrorDeg, kMaxErrorDeg) * std::numbers::pi / 180;
  return {};
}

Answer Sphere::answer(const Wanted& wanted) {
  if (wanted.name == "scene.json") return scene();
  if (wanted.name == "picture") {
    const std::optional<int> side = whole_number(wanted, "side", kSmallestSide, kLargestSide);
    return side ? picture(*side) : Answer::text(400, fmt::format("Give side={} to {}.", kSmallestSide, kLargestSide));
  }
  if (wanted.name == "mesh.glb") {
    const std::optional<int> k = whole_number(wanted, "envelope", 0, static_cast<int>(options_.envelopes.size()) - 1);
    return k ? mesh(static_cast<std::size_t>(*k)) : Answer::text(400, "There is no such envelope.");
  }
  if (wanted.name == "eye") return eye(wanted);
  if (film_ != nullptr && wanted.name == "times.json") return steps_document(film_->times());
  if (film_ != nullptr && wanted.name == "frame") {
    const std::optional<int> k = whole_number(wanted, "k", 0, static_cast<int>(film_->times().size()) - 1);
    return k ? frame(static_cast<std::size_t>(*k)) : Answer::text(400, "The film has no such picture.");
  }
  return Answer::text(404, "There is nothing of this name.");
}

Answer Sphere::scene() const {
  Json envelopes = Json::array();
  for (const NamedEnvelope& each : options_.envelopes)
    envelopes.push_back({{"title", each.title}, {"option", each.option}});
  return document({{"name", std::filesystem::path(options_.file).filename().string()},
                   {"file", options_.file},
                   {"from", options_.from},
                   {"layout", layout_name_},
                   {"width", width_},
                   {"height", height_},
                   {"picture_width", picture_.width},
                   {"picture_height", picture_.height},
                   {"even", layout_->name() == "equirectangular"},
                   {"error_deg", most_error_ * 180 / std::numbers::pi},
                   {"flat", flat_},
                   {"live", options_.live},
                   {"pictures", film_ == nullptr ? 1 : film_->times().size()},
                   {"notes", notes_},
                   {"envelopes", envelopes}});
}

Answer Sphere::picture(int side) {
  const int longer = std::max(picture_.width, picture_.height);
  side = std::min(side, longer);
  if (const auto known = pictures_.find(side); known != pictures_.end()) return known->second;
  Answer answer;
  if (stored_ != nullptr && side == longer) {
    answer = {200, stored_type_, stored_};
  } else {
    media::RaymapFile file;
    file.quality = kQuality;
    auto bytes = media::encode(shrunk(picture_, side), file);
    if (!bytes) return refused(bytes.error());
    answer = {200, "image/jpeg", std::make_shared<const std::vector<std::uint8_t>>(*std::move(bytes))};
  }
  pictures_.clear();  // one is kept: browsers of one computer ask for the same
  pictures_.emplace(side, answer);
  return answer;
}

Answer Sphere::mesh(std::size_t envelope) {
  if (!flat_.empty()) return Answer::text(404, flat_);
  if (const auto known = meshes_.find(envelope); known != meshes_.end()) return known->second;
  auto made = mesh::mesh_of_layout(*layout_, options_.envelopes[envelope].envelope, most_error_);
  // Narrow faces of an envelope may need too many triangles.
  for (double error = 2 * most_error_; !made && made.error().code == Errc::kTooLarge && error < kCoarsest; error *= 2)
    made = mesh::mesh_of_layout(*layout_, options_.envelopes[envelope].envelope, error);
  if (!made) return refused(made.error());
  auto bytes = mesh::encode_mesh(made->mesh, mesh::MeshFormat::kGlb, "");
  if (!bytes) return refused(bytes.error());
  const Answer answer{200, "model/gltf-binary", std::make_shared<const std::vector<std::uint8_t>>(*std::move(bytes))};
  meshes_.emplace(envelope, answer);
  return answer;
}

Answer Sphere::eye(const Wanted& wanted) const {
  const std::optional<int> k = whole_number(wanted, "envelope", 0, static_cast<int>(options_.envelopes.size()) - 1);
  if (!k) return Answer::text(400, "There is no such envelope.");
  constexpr double kFarthest = 1e6;  // as `nodal view --eye` takes it
  const std::optional<double> x = number(wanted, "x"), y = number(wanted, "y"), z = number(wanted, "z");
  if (!x || !y || !z || std::max({std::abs(*x), std::abs(*y), std::abs(*z)}) > kFarthest) {
    return Answer::text(400, "Give x, y and z as numbers from -1000000 to 1000000: right, down and ahead.");
  }
  const geometry::Envelope& envelope = options_.envelopes[static_cast<std::size_t>(*k)].envelope;
  const double distance = std::hypot(*x, *y, *z);
  if (distance > 0 && distance > envelope.rho(geometry::Ray::towards({*x, *y, *z}))) {
    return Answer::text(409,
                        "There the eye would be outside of the shape. Move it less, or choose \"Seen from outside\".");
  }
  const Status seen = envelope.check_eye({*x, *y, *z});
  return seen ? Answer::text(200, "") : Answer::text(409, seen.error().message);
}

Answer Sphere::frame(std::size_t k) {
  auto bytes = film_->frame(k);
  if (!bytes) return refused(bytes.error());
  return {200, "image/jpeg", std::make_shared<const std::vector<std::uint8_t>>(*std::move(bytes))};
}

}  // namespace nodal::host::look
