"""Pictures of calibration boards through a lens with known parameters, drawn without the code under test."""

import cv2
import numpy as np

from dnb_edge.view.boards import Board, BoardKind, charuco_board

TEXTURE_PX_PER_SQUARE = 60
OVERSAMPLING = 2


def board_texture(board):
    """The board on white paper, and the texture px (u, v) of board m (0, 0)."""
    side = TEXTURE_PX_PER_SQUARE
    across, down = board.corners_across
    if board.kind is BoardKind.CHARUCO:
        drawn = charuco_board(board).generateImage((board.columns * side, board.rows * side), marginSize=0)
        origin = 0
    else:
        rows, columns = np.indices(((down + 1) * side, (across + 1) * side)) // side
        drawn = np.where((rows + columns) % 2, 235, 20).astype(np.uint8)
        origin = side
    paper = cv2.copyMakeBorder(drawn, side, side, side, side, cv2.BORDER_CONSTANT, value=245)
    return cv2.GaussianBlur(paper, (5, 5), 1.0), origin + side - 0.5


class Studio:
    """A camera of matrix `k` and OpenCV's distortion `d`, and the board before it."""

    def __init__(self, board: Board, k, d, size, *, fisheye=False):
        self.board, self.k, self.d, self.size, self.fisheye = (
            board,
            np.asarray(k, float),
            np.asarray(d, float),
            size,
            fisheye,
        )
        self._texture, self._origin = board_texture(board)
        fine = np.indices((size[1] * OVERSAMPLING, size[0] * OVERSAMPLING))[::-1].reshape(2, -1).T
        self._rays = self._ray((fine + 0.5) / OVERSAMPLING - 0.5)

    def _ray(self, px):
        """(n, 3) directions seen at camera px (n, 2)."""
        if not self.fisheye:
            straight = cv2.undistortImagePoints(px.reshape(-1, 1, 2).astype(float), self.k, self.d, None, (3, 40, 1e-9))
            return np.column_stack(((straight.reshape(-1, 2) - self.k[:2, 2]) / np.diag(self.k)[:2], np.ones(len(px))))
        off = (px - self.k[:2, 2]) / (self.k[0, 0], self.k[1, 1])
        bent = np.hypot(off[:, 0], off[:, 1])
        theta = np.linspace(0, 1.5, 20000)
        table = theta * (1 + sum(c * theta ** (2 * i + 2) for i, c in enumerate(self.d)))
        angle = np.interp(bent, table, theta)
        aside = off / np.maximum(bent, 1e-12)[:, None] * np.sin(angle)[:, None]
        return np.column_stack((aside, np.cos(angle)))

    def project(self, points_m, rvec, tvec):
        """Camera px (n, 2) of board m (n, 2): the truth."""
        ahead = np.column_stack((points_m, np.zeros(len(points_m))))
        if self.fisheye:
            seen, _ = cv2.fisheye.projectPoints(ahead.reshape(-1, 1, 3), rvec, tvec, self.k, self.d)
        else:
            seen, _ = cv2.projectPoints(ahead, rvec, tvec, self.k, self.d)
        return seen.reshape(-1, 2)

    def picture(self, rvec, tvec, *, noise=2.0, seed=0):
        """The grey picture with the board at this pose (board m to camera axes)."""
        rotation, _ = cv2.Rodrigues(np.asarray(rvec, float))
        plane = np.column_stack((rotation[:, 0], rotation[:, 1], tvec))
        on_board = self._rays @ np.linalg.inv(plane).T
        ahead = on_board[:, 2] > 1e-9
        place = on_board[:, :2] / np.where(ahead, on_board[:, 2], np.inf)[:, None]
        place = place / self.board.square_m * TEXTURE_PX_PER_SQUARE + self._origin
        place[~ahead] = -1e6
        shape = (self.size[1] * OVERSAMPLING, self.size[0] * OVERSAMPLING)
        where = place.astype(np.float32).reshape(*shape, 2)
        seen = cv2.remap(self._texture, where, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=110)
        small = cv2.resize(seen, self.size, interpolation=cv2.INTER_AREA).astype(float)
        return np.clip(small + np.random.default_rng(seed).normal(0, noise, small.shape), 0, 255).astype(np.uint8)


def poses(board: Board, count, *, distance_m, aside=0.5, tilt_deg=35.0, seed=1):
    """(rvec, tvec) of a board shown all over the picture, tilted all ways; `aside`: tangent of the largest angle off axis."""
    random = np.random.default_rng(seed)
    middle = np.append(board.points_m.mean(axis=0), 0.0)
    shown = []
    for _ in range(count):
        tilt = np.radians(tilt_deg) * random.uniform(0.3, 1.0)
        way = random.uniform(0, 2 * np.pi)
        turn = random.uniform(-0.5, 0.5)
        lean, _ = cv2.Rodrigues(tilt * np.array([np.cos(way), np.sin(way), 0.0]))
        spin, _ = cv2.Rodrigues(np.array([0.0, 0.0, turn]))
        rotation = lean @ spin
        far = distance_m * random.uniform(0.8, 1.3)
        centre = np.array([*(far * aside * random.uniform(-1, 1, 2) * (1.0, 0.6)), far])
        rvec, _ = cv2.Rodrigues(rotation)
        shown.append((rvec.ravel(), centre - rotation @ middle))
    return shown
