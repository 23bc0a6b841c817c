#include "host_tool/look/film.h"

#include "host_tool/input/take_heads.h"

namespace nodal::host::look {
namespace {

class OnePicture final : public Film {
 public:
  OnePicture(std::vector<std::uint8_t> jpeg, const std::string& layout) : jpeg_(std::move(jpeg)) {
    times_ = {0};
    layout_ = layout;
  }
  Result<std::vector<std::uint8_t>> frame(std::size_t) override { return jpeg_; }

 private:
  std::vector<std::uint8_t> jpeg_;
};

}  // namespace

std::unique_ptr<Film> film_of(std::vector<std::uint8_t> jpeg, const std::string& layout) {
  return std::make_unique<OnePicture>(std::move(jpeg), layout);
}

bool is_film(const std::string& path) { return is_take(path) || is_matroska(path); }

Result<std::unique_ptr<Film>> open_film(const std::string& path) {
  return is_take(path) ? open_take_raymaps(path) : open_matroska(path);
}

}  // namespace nodal::host::look
