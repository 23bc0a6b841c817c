#include "cable_gadget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "hal/linux/cable/host/cable_link.h"

namespace nodal::hil {

CableGadget::CableGadget(std::string serial, int controller, const std::string& user)
    : name_("nodal" + std::to_string(controller)),
      serial_(std::move(serial)),
      folder_("/run/" + name_ + "_cable"),
      environment_{{"NODAL_GADGET", name_},
                   {"NODAL_SERIAL", serial_},
                   {"NODAL_UDC", "dummy_udc." + std::to_string(controller)}} {
  // What systemd does on a rig: the module and the two file systems.
  shell("modprobe -q libcomposite; mountpoint -q /sys/kernel/config || mount -t configfs configfs /sys/kernel/config");
  const test::Finished made = script("up");
  EXPECT_EQ(made.code, 0) << made.err;
  shell("mkdir -p " + folder_ + " && mount -t functionfs -o uid=$(id -u " + user + "),gid=$(id -g " + user +
        "),rmode=0500,fmode=0600 " + name_ + " " + folder_);
}

CableGadget::~CableGadget() {
  shell("umount " + folder_ + " && rmdir " + folder_);
  const test::Finished removed = script("down");
  EXPECT_EQ(removed.code, 0) << removed.err;
}

void CableGadget::plug() const {
  const test::Finished bound = script("bind");
  EXPECT_EQ(bound.code, 0) << bound.err;
  EXPECT_TRUE(test::wait_until([&] {
    const auto rigs = hal::cable::plugged_rigs();
    return rigs && std::any_of(rigs->begin(), rigs->end(), [&](const auto& rig) { return rig.serial == serial_; });
  }));
}

void CableGadget::unplug() const { std::ofstream("/sys/kernel/config/usb_gadget/" + name_ + "/UDC") << "\n"; }

void CableGadget::shell(const std::string& command) {
  const test::Finished done = test::Process({"sh", "-c", command}).wait();
  EXPECT_EQ(done.code, 0) << command << ": " << done.err;
}

test::Finished CableGadget::script(const std::string& action) const {
  return test::Process({NODAL_SOURCE_DIR "/firmware/daemon/cable", action}, environment_).wait();
}

}  // namespace nodal::hil
