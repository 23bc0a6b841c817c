#include "stitch/offline/offline_blend.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"
#include "stitch/sets/set_blend.h"
#include "stitch/sets/table_job.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::offline {
namespace {

Status check_picture(const blend::BlendTable::Source& source, std::size_t head, const ImageView& picture) {
  if (picture.planes[0].data == nullptr) return {};
  if (picture.format == source.format && picture.width == source.width && picture.height == source.height) return {};
  return fail(Errc::kHeadMismatch,
              fmt::format("head {}: the picture has {}x{} pixels ({}), and its calibration is for {}x{} ({})", head,
                          picture.width, picture.height, pixel_format_name(picture.format), source.width, source.height,
                          pixel_format_name(source.format)));
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
    sets::TableJob job = sets::TableJob::of(std::move(compiler));
    while (!job.done()) {
      job.compile_pieces(2 * workers.threads(), [&](int pieces, const auto& work) { workers.run(pieces, work); });
      if (progress) progress((begun + job.percent() / 100.0) / static_cast<double>(parts.size()));
    }
    begun += 1;
    NODAL_TRY_ASSIGN(auto tables, std::move(job).finish());
    // 8 bits need no exposures, because all heads have those that they were calibrated at.
    blend::ToneTable exposures;
    if (is_linear16(raymap.format)) exposures = table::compile_tone_table(heads, raymap.format);
    made.parts_.push_back(
        {sets::make_plan({}, heads.name, std::move(tables), {}, std::move(exposures)), std::move(part)});
  }
  return made;
}

Result<DecodedImage> OfflineBlend::blend(std::span<const ImageView> pictures) const {
  if (pictures.size() != heads_) {
    return fail(Errc::kHeadMismatch, fmt::format("{} pictures for {} heads; give one a head", pictures.size(), heads_));
  }
  DecodedImage raymap;
  for (const PlanOfPart& part : parts_) {
    const blend::BlendTable& table = part.plan->tables[0];
    std::vector<sets::SetFrame> frames;
    for (std::size_t k = 0; k < part.part.heads.size(); ++k) {
      const std::size_t h = part.part.heads[k];
      NODAL_TRY(check_picture(table.sources[k], h, pictures[h]));
      frames.push_back({pictures[h].planes[0].data != nullptr, pictures[h], {}, {}, {}, 0});
    }
    DecodedImage blended{table.format, table.width, table.height, {}};
    blended.bytes.resize(packed_size(table.format, table.width, table.height));
    const parallel::Workers workers(threads_);
    const auto share = [&](int pieces, const auto& work) { workers.run(pieces, work); };
    sets::SetBlend blend;
    blend.adopt(sets::with_memory(part.plan));
    blend.begin(frames);
    blend.run_rounds(share);
    blend.begin_raymap(0, blended.bytes.data());
    blend.run_rounds(share);
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
