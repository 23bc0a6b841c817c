#include "host_tool/look/head_pictures.h"

#include <algorithm>
#include <utility>

#include "host_tool/look/shrink.h"
#include "protocol/base/try.h"
#include "stitch/media/image_file.h"
#include "stitch/media/raymap/raymap_file.h"

namespace nodal::host::look {
namespace {

constexpr int kHeadQuality = 92;  // quality of JPEGs that are encoded here

std::shared_ptr<const HeadSet> set_of(std::vector<DecodedImage> pictures) {
  auto set = std::make_shared<HeadSet>();
  set->pictures = std::move(pictures);
  for (const DecodedImage& picture : set->pictures) set->grey.emplace_back(picture.view());
  return set;
}

}  // namespace

registration::FrameSet HeadSet::frames() const {
  registration::FrameSet views;
  for (const DecodedImage& picture : pictures) views.push_back(picture.view());
  return views;
}

Result<std::unique_ptr<HeadPictures>> HeadPictures::of(RigPictures& rig) {
  std::unique_ptr<HeadPictures> made(new HeadPictures(rig.calibration));
  NODAL_TRY_ASSIGN(std::vector<DecodedImage> pictures, take_set(rig, 0, true));
  made->set_ = set_of(std::move(pictures));
  return made;
}

Result<std::unique_ptr<HeadPictures>> HeadPictures::of(std::unique_ptr<TakeHeads> take,
                                                       const Calibration& calibration) {
  std::unique_ptr<HeadPictures> made(new HeadPictures(calibration));
  for (const HeadCalibration& head : calibration.heads) {
    const auto place = std::ranges::find(take->heads(), head.name);
    if (place == take->heads().end()) return fail(Errc::kHeadMismatch, "the take has no head '" + head.name + "'");
    made->order_.push_back(static_cast<std::size_t>(place - take->heads().begin()));
  }
  made->take_ = std::move(take);
  NODAL_TRY(made->set(0));
  return made;
}

std::vector<std::int64_t> HeadPictures::times() const {
  return take_ == nullptr ? std::vector<std::int64_t>{0} : take_->times();
}

Result<std::shared_ptr<const HeadSet>> HeadPictures::set(std::size_t k) {
  if (set_ != nullptr && number_ == k) return set_;
  RigPictures rig;
  rig.calibration = calibration_;
  std::vector<HeadPicture>& pictures = rig.sets.emplace_back();
  for (const std::size_t head : order_) {
    NODAL_TRY_ASSIGN(DecodedImage picture, take_->picture(k, head));
    pictures.emplace_back(std::move(picture));
  }
  NODAL_TRY_ASSIGN(std::vector<DecodedImage> decoded, take_set(rig, 0, true));
  set_ = set_of(std::move(decoded));
  number_ = k;
  return set_;
}

Result<std::vector<std::uint8_t>> HeadPictures::jpeg(std::size_t k, std::size_t head, int side) {
  const HeadCalibration& size = calibration_.heads[head];
  if (take_ != nullptr && side >= std::max(size.width, size.height)) {
    NODAL_TRY_ASSIGN(std::vector<std::uint8_t> own, take_->jpeg(k, order_[head]));
    if (!own.empty()) return own;
  }
  media::RaymapFile file;
  file.quality = kHeadQuality;
  if (number_ == k) return media::encode(shrunk(set_->pictures[head], side), file);
  NODAL_TRY_ASSIGN(DecodedImage picture, take_->picture(k, order_[head]));
  return media::encode(shrunk(media::convert_image(picture.view(), PixelFormat::kRgb24), side), file);
}

}  // namespace nodal::host::look
