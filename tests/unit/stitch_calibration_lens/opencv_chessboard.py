# OpenCV's own calibration of photographs of a chessboard: cv2.calibrateCamera, corners by cornerSubPix.
#   opencv_chessboard.py COLUMNS ROWS PHOTO...     (inner corners)
# Prints one JSON document: how many boards were found, and a camera for each distortion model.
import json
import sys
import time

import cv2
import numpy as np

began = time.monotonic()
columns, rows = int(sys.argv[1]), int(sys.argv[2])
board = np.zeros((columns * rows, 3), np.float32)
board[:, :2] = np.mgrid[0:columns, 0:rows].T.reshape(-1, 2)
points, corners, size = [], [], None
for name in sys.argv[3:]:
    image = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
    size = image.shape[::-1]
    found, places = cv2.findChessboardCorners(
        image, (columns, rows), flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        continue
    done = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    corners.append(cv2.cornerSubPix(image, places, (5, 5), (-1, -1), done))
    points.append(board)
cameras = {}
found_seconds = time.monotonic() - began
for model, flags in (("plumb_bob", 0), ("rational", cv2.CALIB_RATIONAL_MODEL)):
    began = time.monotonic()
    rms, K, distortion, _, _ = cv2.calibrateCamera(points, corners, size, None, None, flags=flags)
    cameras[model] = {"rms": rms, "K": K.ravel().tolist(), "distortion": distortion.ravel().tolist(),
                      "seconds": found_seconds + time.monotonic() - began}
print(json.dumps({"boards": len(points), "version": cv2.__version__, "cameras": cameras}))
