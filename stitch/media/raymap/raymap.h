// A raymap with what is known of it, wherever it was made: on a rig, from a take, or from pictures.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"

namespace nodal::media {

/// What belongs to a raymap besides its bytes. Numbers by head are 0 for heads that are not in it.
struct RaymapMeta {
  std::uint64_t set = 0;
  std::uint64_t mid_exposure_ns = 0;  ///< by the rig's clock
  std::string coding{};               ///< "jpeg", or the name of a pixel format
  int width = 0;                      ///< px
  int height = 0;
  std::string layout{};  ///< "equirectangular", "cube:pad=4"
  std::optional<Sha256> calibration_id{};
  std::uint32_t heads_mask = 0;  ///< bit i: head i is in it
  std::uint64_t spread_ns = 0;   ///< latest minus earliest mid-exposure
  std::string genlock{};         ///< the genlock's state
  std::optional<std::uint64_t> trigger{};
  std::optional<std::uint64_t> begin_spread_ns{};
  std::optional<std::int32_t> drift_ppb{};
  std::vector<std::int64_t> offset_ns{};     ///< by head: its mid-exposure after the set's
  std::vector<std::uint64_t> exposure_ns{};  ///< by head
  std::vector<std::int32_t> gain_mdb{};      ///< by head
  std::optional<std::uint32_t> field{};      ///< which of the set's two fields, 0 the earlier
  std::string parity{};                      ///< the field's rows: "top", "bottom"
  /// Raymaps of 16 bits, whose numbers are proportional to light: at 0 dB, the shutter by which the light of 65535 just
  /// fills a sample.
  std::optional<std::uint64_t> full_exposure_ns{};
  std::optional<FrameRate> rate{};  ///< raymaps a second
};

struct Raymap {
  RaymapMeta meta;
  std::vector<std::uint8_t> bytes;  ///< a JPEG, or packed pixels, as meta.coding says
};

/// The pixel format of a raymap that is not coded; nothing for another coding.
std::optional<PixelFormat> raw_format(const RaymapMeta& meta);

/// Every key contains its unit.
nlohmann::ordered_json to_json(const RaymapMeta& meta);

/// The sidecar file that describes a raw file's bytes: the planes in order, their sizes and offsets.
std::string raw_sidecar(const Raymap& raymap);

}  // namespace nodal::media
