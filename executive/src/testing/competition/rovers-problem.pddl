; One rover digs and the other sees; the lander is seen from two of the four places.
(define (problem two-rovers) (:domain rovers)
  (:objects general - lander colour sharp - mode mole lynx - rover bag - store w0 w1 w2 w3 - waypoint
    eye - camera rock peak - objective)
  (:init (lander-at general w0) (visible w0 w1) (visible w1 w0) (visible w2 w0) (visible w0 w2)
    (at mole w1) (digs mole) (store-of bag mole) (empty bag) (soil w2) (soil w3)
    (road mole w1 w3) (road mole w3 w1) (road mole w1 w2) (road mole w2 w1)
    (at lynx w3) (sees lynx) (on eye lynx) (supports eye colour) (supports eye sharp) (target eye rock)
    (road lynx w3 w0) (road lynx w0 w3) (road lynx w0 w1) (road lynx w1 w0)
    (visible-from rock w3) (visible-from rock w1) (visible-from peak w0))
  (:goal (and (told-soil w2) (told-soil w3) (told-image peak colour) (told-image rock sharp))))
