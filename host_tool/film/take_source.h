// The raymaps of a film from a take.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/film/film_plan.h"
#include "host_tool/film/frame_source.h"
#include "stitch/render/take_render.h"
#include "stitch/sets/shown_raymap.h"

namespace nodal::film {

/// Ownership: refers to the plan and to the take.
class TakeSource final : public FrameSource {
 public:
  /// Compiles the tables of the plan's first frame. `compiled` is told the part of a table that is compiled, 0 to 1,
  /// then and later. `options`: those that the plan was made for.
  static Result<std::unique_ptr<TakeSource>> make(const FilmPlan& plan, const media::TakeFolder& take,
                                                  render::RenderOptions options, std::function<void(double)> compiled);
  Status begin(std::uint64_t segment) override;
  Status next(std::span<std::uint8_t> into) override;
  std::vector<std::string> finish() override;
  Result<std::vector<std::uint8_t>> place_seams(std::uint64_t segment) override;
  double seconds() const override { return seconds_; }

 private:
  TakeSource(const FilmPlan& plan, std::unique_ptr<render::TakeRender> render, std::function<void(double)> compiled)
      : plan_(plan), render_(std::move(render)), compiled_(std::move(compiled)) {}
  Status show(std::int64_t raymap);

  const FilmPlan& plan_;
  std::unique_ptr<render::TakeRender> render_;
  std::function<void(double)> compiled_;
  sets::ShownRaymap in_8_bits_;
  std::vector<std::uint8_t> seams_;      ///< labels in force; empty: the calibration's own
  std::uint64_t begin_ = 0, frame_ = 0;  ///< the segment's first frame, and the next one
  std::optional<std::int64_t> shown_;    ///< number of the raymap in rendered_
  render::RenderedRaymap rendered_;
  std::uint64_t incomplete_ = 0, undecodable_ = 0;  ///< raymaps without a head, pictures; of the segment
  double seconds_ = 0;
};

}  // namespace nodal::film
