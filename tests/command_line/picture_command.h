// A fixture for commands that convert pictures.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {

class PictureCommand : public RigTest {
 protected:
  void expect_refused(const Words& words, const std::string& says) const {
    const Finished run = nodal(words);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
  }
  double psnr_of(const std::string& a, const std::string& b) const {
    return test::psnr(media::read_image(path(a), PixelFormat::kRgb24).value().bytes,
                      media::read_image(path(b), PixelFormat::kRgb24).value().bytes);
  }
};

}  // namespace nodal::command_line
