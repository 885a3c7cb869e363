"""The paper's pipeline: one file a phase, its name the stage's name.

| equation | what | function |
|---|---|---|
| 2 | Mahalanobis distance to the road's colour | `similarity.bind`, `similarity.fit` |
| 3 | value | `shadow.value` |
| 4 | saturation | `shadow.saturation` |
| 5 | hue | `shadow.hue` |
| 6 | NDI | `shadow.ndi` |
| 7 | Otsu's threshold | `shadow.otsu_threshold`, `shadow.printed_threshold` |
| 8 | shadow mask | `shadow.shadow_mask` |
| 9 | connected components | `shadow.connected_components` |
| 10 | buffer rings | `shadow.buffer_ring`, `shadow.ring_pairs` |
| 11 | compensation | `shadow.compensation`, `shadow.compensate` |
| 12-16 | support vector machine | `svm.fit` (14), `svm.decision` (15, 16) |
| 17 | dilation | `post.dilate` |
| 18 | erosion | `post.erode` |
| 20 | opening | `post.opening` |
| 21 | closing | `post.closing` |
| 22 | boundary | `post.boundary` |
| 23 | holes | `post.fill_holes` |
| 24-29 | rates | in the room roadeval.evaluation |
"""
