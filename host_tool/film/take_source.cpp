#include "host_tool/film/take_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::film {

Result<std::unique_ptr<TakeSource>> TakeSource::make(const FilmPlan& plan, const media::TakeFolder& take,
                                                     render::RenderOptions options,
                                                     std::function<void(double)> compiled) {
  options.raymap = plan.raymap;
  options.from = {};  // the plan says which raymaps are shown
  options.to = render::RenderOptions{}.to;
  NODAL_TRY_ASSIGN(auto render, render::TakeRender::make(take, std::move(options)));
  auto source = std::unique_ptr<TakeSource>(new TakeSource(plan, std::move(render), std::move(compiled)));
  NODAL_TRY(source->show(plan.take->raymaps.front()));
  source->seconds_ = 0;
  return source;
}

/// Renders it into rendered_.
Status TakeSource::show(std::int64_t raymap) {
  if (shown_ == raymap) return {};
  const auto begun = std::chrono::steady_clock::now();
  if (!shown_ || raymap != *shown_ + 1) render_->seek(static_cast<std::uint64_t>(raymap), seams_);
  NODAL_TRY_ASSIGN(const bool more, render_->next(rendered_, compiled_));
  if (!more) return fail(Errc::kTruncated, fmt::format("{}: the take has no raymap {}", plan_.take->folder, raymap));
  shown_ = raymap;
  if (rendered_.heads != (std::uint32_t{1} << plan_.take->heads.size()) - 1) ++incomplete_;
  if (rendered_.field.value_or(0) == 0) undecodable_ += rendered_.undecodable_heads;
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return {};
}

Status TakeSource::begin(std::uint64_t segment) {
  begin_ = frame_ = plan_.begin_of(segment);
  const PlannedSeams* const seams = plan_.seams_at(segment);
  seams_ = seams ? seams->labels : std::vector<std::uint8_t>{};
  shown_.reset();
  incomplete_ = undecodable_ = 0;
  return {};
}

Status TakeSource::next(std::span<std::uint8_t> into) {
  NODAL_TRY(show(plan_.take->raymaps[frame_++]));
  const DecodedImage& raymap = rendered_.pixels;
  if (raymap.format == plan_.coding.format) {
    std::ranges::copy(raymap.bytes, into.begin());
    return {};
  }
  const ImageView shown = in_8_bits_.in_8_bits(raymap.view(), rendered_.linear);
  std::copy_n(shown.planes[0].data, into.size(), into.begin());  // packed
  return {};
}

std::vector<std::string> TakeSource::finish() {
  std::vector<std::string> notes;
  const auto add = [&](std::uint64_t count, const std::string& what) {
    if (count == 0) return;
    notes.push_back(fmt::format("{}: frames {} to {}: {} {}", plan_.take->folder, begin_, frame_ - 1, count, what));
  };
  add(incomplete_, "of them lack a head, which delivered no picture");
  add(undecodable_, "pictures of heads cannot be decoded and are missing");
  return notes;
}

Result<std::vector<std::uint8_t>> TakeSource::place_seams(std::uint64_t segment) {
  const auto raymap = static_cast<std::uint64_t>(plan_.take->raymaps[plan_.begin_of(segment)]);
  const PlannedSeams* const before = plan_.seams_at(segment);
  shown_.reset();
  return render_->suitable_seams(raymap, before ? before->labels : std::vector<std::uint8_t>{});
}

}  // namespace nodal::film
