// Pictures that commands make, as files: the one place where a result's colours and metadata are written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_tool/commands/picture_file.h"
#include "host_tool/input/kept_metadata.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct ResultFile {
  RaymapFormat format = RaymapFormat::kJpg;
  int quality = 92;           ///< quality of a JPEG
  std::string comment{};      ///< comment of a JPEG
  bool whole_sphere = false;  ///< equirectangular: with GPano metadata
  KeptMetadata kept{};
};

/// Numbers that are proportional to light are in sRGB in a JPEG, which has 8 bits; a PNG says that they are linear by
/// gAMA, a TIFF by a profile, and both by a comment.
/// Errors: kUnsupported, kTooLarge, kInternal of the writers.
Result<std::vector<std::uint8_t>> encode_result(const DecodedImage& picture, const ResultFile& file);

}  // namespace nodal::host
