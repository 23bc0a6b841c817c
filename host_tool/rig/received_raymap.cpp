#include "host_tool/rig/received_raymap.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "host_tool/rig/rig_input.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

constexpr std::uint32_t kMaxRaymapSide = 16384;       // rig.toml's limit for raymap.width
constexpr std::uint64_t kMaxJpegOverhead = 1U << 20;  // bytes of a JPEG beside its pixels: headers, metadata

}  // namespace

Result<media::RaymapMeta> parse_raymap_meta(const std::string& bytes) {
  NODAL_TRY_ASSIGN(const auto header, parse_clean<wire::RaymapHeader>(bytes, "header of a raymap"));
  if (header.width() == 0 || header.height() == 0 || header.width() > kMaxRaymapSide ||
      header.height() > kMaxRaymapSide) {
    return fail(Errc::kBadFormat, fmt::format("raymap of set {}: {}×{} is not a valid size", header.set(),
                                              header.width(), header.height()));
  }
  media::RaymapMeta meta;
  meta.set = header.set();
  meta.mid_exposure_ns = header.mid_exposure_ns();
  meta.coding = header.coding();
  meta.width = static_cast<int>(header.width());
  meta.height = static_cast<int>(header.height());
  meta.layout = header.layout();
  if (header.calibration_id().size() == sizeof(Sha256))
    std::ranges::copy(header.calibration_id(), meta.calibration_id.emplace().begin());
  meta.heads_mask = header.heads_mask();
  meta.spread_ns = header.spread_ns();
  meta.genlock = header.genlock();
  if (header.has_trigger()) meta.trigger = header.trigger();
  if (header.has_begin_spread_ns()) meta.begin_spread_ns = header.begin_spread_ns();
  if (header.has_drift_ppb()) meta.drift_ppb = header.drift_ppb();
  meta.offset_ns.assign(header.offset_ns().begin(), header.offset_ns().end());
  meta.exposure_ns.assign(header.exposure_ns().begin(), header.exposure_ns().end());
  meta.gain_mdb.assign(header.gain_mdb().begin(), header.gain_mdb().end());
  if (header.has_field()) meta.field = header.field();
  meta.parity = header.parity();
  if (header.has_full_exposure_ns()) meta.full_exposure_ns = header.full_exposure_ns();
  meta.rate = FrameRate::make(header.rate_numerator(), header.rate_denominator());
  return meta;
}

Result<std::uint64_t> most_raymap_bytes(const media::RaymapMeta& meta) {
  if (meta.coding == "jpeg") {
    return static_cast<std::uint64_t>(meta.width) * static_cast<std::uint64_t>(meta.height) * 3 + kMaxJpegOverhead;
  }
  const std::optional<PixelFormat> format = media::raw_format(meta);
  if (format) return packed_size(*format, meta.width, meta.height);
  return fail(Errc::kUnsupported, fmt::format("raymap of set {}: the coding '{}' is unknown; is the rig newer "
                                              "than this program?",
                                              meta.set, meta.coding));
}

Status check_raymap(const media::Raymap& raymap) {
  const media::RaymapMeta& meta = raymap.meta;
  const std::size_t size = raymap.bytes.size();
  NODAL_TRY_ASSIGN(const std::uint64_t wanted, most_raymap_bytes(meta));
  if (meta.coding == "jpeg") {
    const auto& b = raymap.bytes;
    if (size < 4 || b[0] != 0xFF || b[1] != 0xD8) {
      return fail(Errc::kBadFormat, fmt::format("raymap of set {}: it does not begin as a JPEG", meta.set));
    }
    if (b[size - 2] != 0xFF || b[size - 1] != 0xD9) {
      return fail(Errc::kTruncated, fmt::format("raymap of set {}: its JPEG has no end", meta.set));
    }
    return {};
  }
  if (size != wanted) {
    return fail(Errc::kTruncated, fmt::format("raymap of set {}: {} bytes instead of {}", meta.set, size, wanted));
  }
  return {};
}

Result<std::optional<media::Raymap>> RaymapAssembly::add(const BulkPiece& piece) {
  if (piece.first) {
    NODAL_TRY(begin(piece));
  }
  bytes_.add(piece);
  if (!piece.last) return std::nullopt;
  return media::Raymap{std::move(meta_), bytes_.take()};
}

Status RaymapAssembly::begin(const BulkPiece& piece) {
  NODAL_TRY_ASSIGN(meta_, parse_raymap_meta(piece.meta));
  if ((meta_.coding == "jpeg") != (coding_ == "jpeg")) {
    return fail(Errc::kBadFormat, "the rig sent a raymap of coding '" + meta_.coding + "', which was not asked for");
  }
  NODAL_TRY_ASSIGN(const std::uint64_t most, most_raymap_bytes(meta_));
  return bytes_.begin(piece, most, "a raymap");
}

}  // namespace nodal::host
