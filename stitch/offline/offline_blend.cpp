#include "stitch/offline/offline_blend.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/blend/prepare.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::offline {
namespace {

constexpr int kCompiledRows = 8;  ///< rows of tiles that a thread compiles at once: they share some of the work
constexpr int kBandRows = 64;     ///< raymap rows per band: the blend is fastest with multiples of 64

/// A head's picture and its pyramid, as the blend reads them.
struct Prepared {
  std::vector<std::uint8_t> memory;
  std::vector<ImageView> levels = std::vector<ImageView>(blend::kMaxPictures);
};

Status check_picture(const blend::BlendTable::Source& source, std::size_t head, const ImageView& picture) {
  if (picture.planes[0].data == nullptr) return {};
  if (picture.format == source.format && picture.width == source.width && picture.height == source.height) return {};
  return fail(Errc::kHeadMismatch,
              "head " + std::to_string(head) + ": the picture has " + std::to_string(picture.width) + "x" +
                  std::to_string(picture.height) + " pixels (" + std::string(pixel_format_name(picture.format)) +
                  "), and its calibration is for " + std::to_string(source.width) + "x" +
                  std::to_string(source.height) + " (" + std::string(pixel_format_name(source.format)) + ")");
}

/// Every head at the exposure that it was calibrated at.
blend::SetTone tone_of(const Calibration& calibration, const blend::BlendTable& table) {
  if (!is_linear16(table.format)) return blend::calibrated_tone(table);
  const std::vector<blend::ExposedHead> alike(calibration.heads.size());
  return blend::linear_tone(table, table::compile_tone_table(calibration, table.format), alike);
}

DecodedImage blend_with(const blend::BlendTable& table, const blend::SetTone& tone, std::span<const ImageView> pictures,
                        int threads) {
  const std::size_t heads = pictures.size();
  const parallel::Workers workers(threads);
  std::vector<Prepared> prepared(heads);
  workers.run(static_cast<int>(heads), [&](int i) {
    const auto h = static_cast<std::size_t>(i);
    if (pictures[h].planes[0].data == nullptr) return;
    prepared[h].memory.resize(blend::prepared_size(table.sources[h]));
    blend::prepare_picture(table.sources[h], pictures[h], prepared[h].memory.data(), prepared[h].levels);
  });
  std::vector<ImageView> views(heads * blend::kMaxPictures);
  for (std::size_t h = 0; h < heads; ++h) {
    for (std::size_t l = 0; l < table.sources[h].pictures(); ++l) views[l * heads + h] = prepared[h].levels[l];
  }
  DecodedImage raymap{table.format, table.width, table.height, {}};
  raymap.bytes.resize(packed_size(raymap.format, raymap.width, raymap.height));
  const MutableImageView into = packed_image(raymap.format, raymap.width, raymap.height, raymap.bytes.data());
  const int bands = (raymap.height + kBandRows - 1) / kBandRows;
  workers.run(bands, [&](int band) {
    blend::blend_rows(table, views, tone, into, band * kBandRows, std::min(raymap.height, (band + 1) * kBandRows));
  });
  return raymap;
}

}  // namespace

Result<double> resolution_of(const Calibration& calibration) {
  NODAL_TRY_ASSIGN(const auto heads, geometry::make_heads(calibration));
  double most = 0;
  for (const geometry::Head& head : heads) {
    const Region& region = head.calibration().region;
    geometry::Pixel middle{(region.left + region.right) / 2, (region.top + region.bottom) / 2};
    if (region.circle) middle = {region.circle->x, region.circle->y};
    most = std::max(most, std::sqrt(head.density(middle)));
  }
  return most;
}

Result<OfflineBlend> OfflineBlend::make(const Calibration& calibration, const table::RaymapSpec& raymap,
                                        const table::TableOptions& options, PixelFormat head_format, int threads,
                                        const std::function<void(double)>& progress, std::size_t heads_per_part) {
  NODAL_TRY_ASSIGN(const auto layout, geometry::make_layout(raymap.layout, raymap.width, raymap.height));
  NODAL_TRY_ASSIGN(auto parts, cut_into_parts(calibration, *layout, heads_per_part));
  OfflineBlend made(calibration.heads.size(), threads);
  const parallel::Workers workers(threads);
  double begun = 0;
  for (Part& part : parts) {
    const Calibration heads = calibration_of(part, calibration);
    const PartLayout some(*layout, part);
    const geometry::RaymapLayout* rays = &some;
    if (parts.size() == 1) rays = layout.get();
    const std::vector<PixelFormat> formats(heads.heads.size(), head_format);
    NODAL_TRY_ASSIGN(auto compiler, table::TableCompiler::make(heads, *rays, raymap.format, formats, options));
    const int rows = compiler.row_count();
    const int at_once = 2 * workers.threads();  // chunks between two calls of progress()
    for (int done = 0; done < rows;) {
      workers.run(at_once, [&](int i) {
        const int first = std::min(rows, done + i * kCompiledRows);
        compiler.compile_rows(first, std::min(rows, first + kCompiledRows));
      });
      done = std::min(rows, done + at_once * kCompiledRows);
      if (progress) progress((begun + static_cast<double>(done) / rows) / static_cast<double>(parts.size()));
    }
    begun += 1;
    NODAL_TRY_ASSIGN(auto table, std::move(compiler).finish());
    const blend::SetTone tone = tone_of(heads, table);
    made.parts_.push_back({std::move(table), tone, std::move(part)});
  }
  return made;
}

Result<DecodedImage> OfflineBlend::blend(std::span<const ImageView> pictures) const {
  if (pictures.size() != heads_) {
    return fail(Errc::kHeadMismatch, std::to_string(pictures.size()) + " pictures for " + std::to_string(heads_) +
                                         " heads; give one a head");
  }
  DecodedImage raymap;
  for (const TableOfPart& part : parts_) {
    std::vector<ImageView> of_part;
    for (std::size_t k = 0; k < part.part.heads.size(); ++k) {
      const std::size_t h = part.part.heads[k];
      NODAL_TRY(check_picture(part.table.sources[k], h, pictures[h]));
      of_part.push_back(pictures[h]);
    }
    DecodedImage blended = blend_with(part.table, part.tone, of_part, threads_);
    if (raymap.bytes.empty()) {  // black where the part has no blocks
      raymap = std::move(blended);
    } else {
      copy_blocks(part.part, blended.view(),
                  packed_image(raymap.format, raymap.width, raymap.height, raymap.bytes.data()));
    }
  }
  if (is_linear16(raymap.format)) raymap.meaning = SampleMeaning::linear();
  return raymap;
}

}  // namespace nodal::offline
