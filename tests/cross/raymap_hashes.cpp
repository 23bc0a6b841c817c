// Prints the SHA-256 of blend tables and of their raymaps, compiled and blended on this machine: two machines with the
// same output stitch the same bytes. Pictures are integer noise; the rigs have all lens models, pixel formats, gains,
// vignetting and responses, and one has ten heads with Figure 3's lens. Every layout and every transition occurs.
#include <cstdio>
#include <string>
#include <vector>

#include "protocol/base/sha256.h"
#include "protocol/calibration.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/rotation.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/tone_compiler.h"
#include "tests/reference/prepared_heads.h"

namespace nodal {
namespace {

/// Knuth's MMIX generator: the same numbers everywhere.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}
  std::uint32_t next() {
    state_ = state_ * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::uint32_t>(state_ >> 32);
  }

 private:
  std::uint64_t state_;
};

HeadCalibration head_at(int index, int width, int height, LensModel lens, geometry::YawPitchRoll pose) {
  HeadCalibration head;
  head.name = "head" + std::to_string(index);
  head.width = width;
  head.height = height;
  head.center_x = width / 2.0 + 0.8;
  head.center_y = height / 2.0 - 1.3;
  head.lens = std::move(lens);
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig(pose));
  head.region = {0, 0, static_cast<double>(width), static_cast<double>(height), std::nullopt};
  head.vignetting = {head.center_x, head.center_y, width * 0.6, {-0.2, -0.08, 0}};
  head.gain = {1 + 0.01 * index, 1 - 0.005 * index, 1 + 0.002 * index};
  return head;
}

/// The paper's rig: four heads up, four down, two at the poles.
Calibration ten_heads() {
  Calibration rig;
  rig.name = "ten heads";
  for (int h = 0; h < 10; ++h) {
    const double down = h < 4 ? 0 : 45;
    geometry::YawPitchRoll pose{(h % 4) * 90.0 + down, h < 4 ? 31.0 : -31.0, 0};
    if (h >= 8) pose = {20, h == 8 ? 90.0 : -90.0, 0};
    rig.heads.push_back(head_at(h, 720, 480, TsaiLens{490, 2.29e-6, 1.65e-11}, pose));
    rig.heads.back().aspect = 1.083;
    rig.heads.back().response = {Response::Curve::kGamma, 2.2, {}};
  }
  return rig;
}

/// Symmetric on purpose: rays exactly between samples, and exactly equal weights.
Calibration symmetric() {
  Calibration rig;
  rig.name = "symmetric";
  for (int h = 0; h < 4; ++h) {
    HeadCalibration head = head_at(h, 256, 256, EquidistantLens{{128 / 1.8}}, {h * 90.0, 0, 0});
    head.center_x = head.center_y = 128;
    head.region.circle = {128, 128, 126};
    head.max_angle = 1.8;
    head.gain = {1, 1, 1};
    head.vignetting = {128, 128, 128, {0, 0, 0}};
    rig.heads.push_back(head);
  }
  return rig;
}

Calibration mixed() {
  Calibration rig;
  rig.name = "mixed";
  rig.heads.push_back(head_at(0, 320, 240, KannalaBrandtLens{95, {0.03, -0.004, 0, 0}}, {10, 5, 90}));
  rig.heads.push_back(head_at(1, 318, 242, RectilinearLens{{170, 0, -9}}, {130, -20, 7}));
  rig.heads.push_back(head_at(2, 320, 240, EquidistantLens{{100, 3, -2}}, {-120, 12, -33}));
  for (HeadCalibration& head : rig.heads) head.max_angle = 0.9;
  rig.heads[0].max_angle = rig.heads[2].max_angle = 2.0;
  rig.heads[1].response = {Response::Curve::kSrgb, 1, {}};
  rig.heads[2].response = {Response::Curve::kPolynomial, 1, {0.3, 0.5, 0.2}};
  return rig;
}

void add(Sha256Stream& hash, const void* data, std::size_t bytes) {
  hash.update({static_cast<const std::uint8_t*>(data), bytes});
}

/// Returns whether it worked.
bool print_case(const Calibration& rig, const table::RaymapSpec& spec, const std::vector<PixelFormat>& formats,
                const table::TableOptions& options = {}) {
  const Result<blend::BlendTable> table = table::compile_blend_table(rig, spec, formats, options);
  if (!table) {
    std::fprintf(stderr, "%s: %s\n", rig.name.c_str(), table.error().text().c_str());
    return false;
  }
  Sha256Stream table_hash;
  for (const blend::BlendTable::Source& source : table->sources) {
    add(table_hash, source.gain.data(), sizeof source.gain);
  }
  for (const blend::GridTable& grid : table->grids) {
    add(table_hash, grid.tiles.data(), grid.tiles.size() * sizeof grid.tiles[0]);
    add(table_hash, grid.records.data(), grid.records.size() * sizeof grid.records[0]);
    add(table_hash, grid.weights.data(), grid.weights.size() * sizeof grid.weights[0]);
    add(table_hash, grid.coordinates.data(), grid.coordinates.size() * sizeof grid.coordinates[0]);
    add(table_hash, grid.gains.data(), grid.gains.size() * sizeof grid.gains[0]);
  }
  Noise noise(rig.heads.size());
  std::vector<std::vector<std::uint8_t>> pixels;
  std::vector<ImageView> heads;
  for (const blend::BlendTable::Source& source : table->sources) {
    pixels.emplace_back(packed_size(source.format, source.width, source.height));
    for (std::uint8_t& byte : pixels.back()) byte = static_cast<std::uint8_t>(noise.next() >> 24);
    heads.push_back(packed_image(source.format, source.width, source.height, std::as_const(pixels.back()).data()));
  }
  const blend::ToneTable tones = table::compile_tone_table(rig, spec.format);
  std::vector<blend::ExposedHead> exposed(rig.heads.size(), {10 * kStop, 0});
  exposed[0].exposure += 3 * kStop / 2;
  const blend::SetTone tone =
      is_linear16(spec.format) ? blend::linear_tone(*table, tones, exposed) : blend::calibrated_tone(*table);
  std::vector<std::uint8_t> raymap(packed_size(spec.format, spec.width, spec.height));
  blend::blend_rows(*table, test::PreparedHeads(*table, heads).views(), tone,
                    packed_image(spec.format, spec.width, spec.height, raymap.data()), 0, spec.height);
  std::printf("%-10s %-24s %-6s transition %d table %s raymap %s\n", rig.name.c_str(), spec.layout.c_str(),
              std::string(pixel_format_name(spec.format)).c_str(), static_cast<int>(options.transition),
              to_hex(table_hash.finish()).c_str(), to_hex(sha256(raymap)).c_str());
  return true;
}

bool print_every_layout_and_transition(const Calibration& rig) {
  std::vector<std::string> layouts{"cube:pad=3", "equiangular_cube:pad=2", "central_cylinder:fov=140"};
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) layouts.emplace_back(kind.name);
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kGrey8);
  for (const std::string& layout : layouts) {
    const geometry::RaymapSize size = geometry::LayoutName::parse(layout).value().size_for_width(48);
    for (const auto transition : {Transition::kTwoBand, Transition::kSeam, Transition::kFeather}) {
      if (transition != Transition::kTwoBand && layout != "cube") continue;
      table::TableOptions options;
      options.transition = transition;
      if (!print_case(rig, {layout, size.width, size.height, PixelFormat::kGrey8}, formats, options)) return false;
    }
  }
  return true;
}

}  // namespace
}  // namespace nodal

int main() {
  using namespace nodal;
  using enum PixelFormat;
  const std::vector<PixelFormat> any_yuv{kNv12, kYuyv, kUyvy};
  const bool good = print_case(ten_heads(), {"equirectangular", 512, 256, kI420}, std::vector(10, kYuyv)) &&
                    print_case(ten_heads(), {"cube", 384, 256, kRgb24}, std::vector(10, kRgb24)) &&
                    print_case(symmetric(), {"equirectangular", 384, 192, kRgb24}, std::vector(4, kRgb24)) &&
                    print_case(symmetric(), {"cube", 384, 256, kGrey8}, std::vector(4, kGrey8)) &&
                    print_case(mixed(), {"equirectangular", 512, 256, kI420}, any_yuv) &&
                    print_case(mixed(), {"cube", 384, 256, kRgb24}, std::vector(3, kRgb24)) &&
                    print_case(ten_heads(), {"equirectangular", 512, 256, kNv12}, std::vector(10, kYuyv)) &&
                    print_case(ten_heads(), {"equirectangular", 512, 256, kRgb48}, std::vector(10, kRgb24)) &&
                    print_case(mixed(), {"cube", 384, 256, kGrey16}, std::vector(3, kGrey8)) &&
                    print_every_layout_and_transition(mixed());
  return good ? 0 : 1;
}
