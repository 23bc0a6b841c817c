// A rig's USB gadget in the guest: made by the script of the Debian package, plugged to the same kernel's host
// controller.
#pragma once

#include <map>
#include <string>

#include "tests/support/process.h"

namespace nodal::hil {

class CableGadget {
 public:
  /// `controller`: 0 or 1, of dummy_hcd. `user` will own the folder.
  explicit CableGadget(std::string serial, int controller = 0, const std::string& user = "root");
  ~CableGadget();
  CableGadget(const CableGadget&) = delete;
  CableGadget& operator=(const CableGadget&) = delete;

  const std::string& folder() const { return folder_; }
  const std::string& serial() const { return serial_; }
  /// Plugs the cable; nodald, or a listener, has opened the folder. Returns when the host has found the rig.
  void plug() const;
  /// Pulls the cable out.
  void unplug() const;
  test::Finished script(const std::string& action) const;

 private:
  static void shell(const std::string& command);

  std::string name_;
  std::string serial_;
  std::string folder_;
  std::map<std::string, std::string> environment_;
};

}  // namespace nodal::hil
