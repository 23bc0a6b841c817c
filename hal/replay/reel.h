// The frames of one head, in order.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "hal/head.h"
#include "hal/replay/picture_reader.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/field.h"

namespace nodal::hal::replay {

struct Shot {
  bool present = true;  ///< false: the head has no frame here
  /// Null: it cannot be read, or its format or size is another one.
  std::shared_ptr<const DecodedImage> picture{};
  HeadSettings in_effect{};
};

/// Threading: thread-bound.
/// Ownership: a picture lives as long as it has a holder.
/// Errors: shots that cannot be read are without a picture.
class Reel {
 public:
  virtual ~Reel() = default;
  virtual std::size_t size() const = 0;  ///< at least 1
  virtual PixelFormat format() const = 0;
  virtual int width() const = 0;  ///< px
  virtual int height() const = 0;
  virtual ColourCoding coding() const { return {}; }
  /// Nothing: the pictures do not say.
  virtual std::optional<Fields> fields() const { return std::nullopt; }
  virtual std::optional<FrameRate> rate() const { return std::nullopt; }
  /// A whole sentence about files that are not played, such as those in a folder of pictures; empty: there are none.
  virtual std::string left_out() const { return {}; }
  virtual Shot shot(std::size_t i) = 0;
};

/// Picture files. `where` is a file, a folder (all its pictures) or a glob(7) pattern; at most `keep_bytes` of decoded
/// pictures are kept in memory. Errors: kNoSuchDevice if there is no picture; kBadValue if sizes differ; those of a
/// broken picture, and of a file in a folder that is called like a picture and is none.
Result<std::unique_ptr<Reel>> open_pictures(const std::filesystem::path& where, std::optional<PixelFormat> as,
                                            std::uint64_t keep_bytes, const PictureReader& reader);
/// Whether there is a file to open.
bool pictures_present(const std::filesystem::path& where);

}  // namespace nodal::hal::replay
